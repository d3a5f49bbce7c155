// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/help.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <vector>

namespace lenticule::cli {
namespace {

constexpr size_t kTextColumn = 30;
constexpr size_t kLineWidth = 100;

/// Value describes what an option takes.
struct Value {
  std::string name{};    ///< "N", "real|simulated"
  std::string limits{};  ///< "2 to 4096"
};

/// Splits CLI11's name of a type, to which it adds the checks: "INT:INT in [2 - 4096]",
/// "TEXT:{real,simulated}", "FLOAT:POSITIVE".
Value value_of(const CLI::Option& option) {
  Value value;
  std::string& name = value.name;
  name = option.get_type_name();
  if (const size_t words = name.find(":{"); words != std::string::npos) {
    if (name.starts_with("TEXT:")) {
      name = name.substr(words + 2, name.size() - words - 3);
      std::replace(name.begin(), name.end(), ',', '|');
    } else {
      name.resize(words);
    }
  } else if (const size_t range = name.find(" in ["); range != std::string::npos) {
    value.limits = name.substr(range + 5, name.size() - range - 6);
    value.limits.replace(value.limits.find(" - "), 3, " to ");
    name.resize(name.rfind(':', range));
  } else if (name.ends_with(":POSITIVE") || name.ends_with(":NONNEGATIVE")) {
    name.resize(name.rfind(':'));
  }
  if (name == "INT" || name == "UINT") name = "N";
  if (name == "FLOAT") name = "NUMBER";
  return value;
}

bool takes_value(const CLI::Option& option) {
  return option.get_expected_max() > 0 && option.get_type_size() != 0;
}

/// Returns the name and the text, broken into lines that begin at kTextColumn.
std::string aligned(const std::string& name, const std::string& text) {
  std::string out =
      name + (name.size() + 1 < kTextColumn ? std::string(kTextColumn - name.size(), ' ')
                                            : "\n" + std::string(kTextColumn, ' '));
  size_t column = kTextColumn;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find(' ', begin), text.size());
    if (column > kTextColumn && column + end - begin > kLineWidth) {
      out.back() = '\n';
      out.append(kTextColumn, ' ');
      column = kTextColumn;
    }
    out.append(text, begin, end - begin) += ' ';
    column += end - begin + 1;
    begin = end + 1;
  }
  out.back() = '\n';
  return out;
}

class HelpFormatter final : public CLI::Formatter {
 public:
  HelpFormatter() { label("Positionals", "Arguments"); }

  std::string make_option(const CLI::Option* option, bool /*is_positional*/) const override {
    return aligned("  " + typed_form(*option), explanation(*option, HelpLength::Short));
  }

  std::string make_subcommand(const CLI::App* sub) const override {
    return aligned("  " + sub->get_display_name(true), sub->get_description());
  }

  std::string make_footer(const CLI::App* app) const override {
    const std::vector<const CLI::Option*> longer = app->get_options([](const CLI::Option* option) {
      return option->get_description().find('\n') != std::string::npos;
    });
    return CLI::Formatter::make_footer(app) +
           (longer.empty() ? "" : "\nMore about the flags: lenticule man | man -l -\n");
  }
};

}  // namespace

std::string typed_form(const CLI::Option& option) {
  if (!option.nonpositional()) return option.get_name(true);
  const std::string name = option.get_name(false, true);
  return takes_value(option) ? name + " " + value_of(option).name : name;
}

std::string explanation(const CLI::Option& option, HelpLength length) {
  std::string text = option.get_description();
  if (length == HelpLength::Short) text = text.substr(0, text.find('\n'));
  std::vector<std::string> notes;
  if (option.get_required()) notes.emplace_back("required");
  if (const Value value = value_of(option); !value.limits.empty()) notes.push_back(value.limits);
  if (!option.get_default_str().empty()) notes.push_back("default: " + option.get_default_str());
  return notes.empty() ? text : fmt::format("{} [{}]", text, fmt::join(notes, "; "));
}

std::shared_ptr<CLI::FormatterBase> make_help_formatter() {
  return std::make_shared<HelpFormatter>();
}

}  // namespace lenticule::cli
