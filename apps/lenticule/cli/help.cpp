// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/help.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>

namespace lenticule::cli {

std::vector<const CLI::App*> visible_commands(const CLI::App& app) {
  std::vector<const CLI::App*> result;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!sub->get_group().empty()) result.push_back(sub);
  return result;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : visible_commands(app)) names.push_back(command->get_name());
  return names;
}

std::vector<const CLI::Option*> flags(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) {
    return option->nonpositional() && !option->get_group().empty();
  });
}

std::vector<const CLI::Option*> positionals(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) {
    return option->get_positional() && !option->nonpositional();
  });
}

bool takes_value(const CLI::Option& option) {
  return option.get_expected_max() > 0 && option.get_type_size() != 0;
}

namespace {

constexpr size_t kTextColumn = 30;
constexpr size_t kLineWidth = 100;

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

/// CLI11 adds the checks to the name of a type: "INT:INT in [2 - 4096]", "TEXT:{real,simulated}",
/// "FLOAT:POSITIVE".
ValueType value_type(const CLI::Option& option) {
  ValueType type;
  std::string& name = type.name;
  name = option.get_type_name();
  type.whole = name.starts_with("INT") || name.starts_with("UINT");
  if (name.starts_with("UINT")) type.limits = "of 0 or more";
  if (const size_t words = name.find(":{"); words != std::string::npos) {
    type.words = name.substr(words + 2, name.size() - words - 3);
    const bool is_text = name.starts_with("TEXT:");
    name = is_text ? type.words : name.substr(0, words);
    if (is_text) std::replace(name.begin(), name.end(), ',', '|');
  } else if (const size_t range = name.find(" in ["); range != std::string::npos) {
    type.range = name.substr(range + 5, name.size() - range - 6);
    type.range.replace(type.range.find(" - "), 3, " to ");
    type.limits = "from " + type.range;
    name.resize(name.rfind(':', range));
  } else if (name.ends_with(":POSITIVE") || name.ends_with(":NONNEGATIVE")) {
    type.limits = name.ends_with(":POSITIVE") ? "above 0" : "of 0 or more";
    name.resize(name.rfind(':'));
  }
  if (name == "INT" || name == "UINT") name = "N";
  if (name == "FLOAT") name = "NUMBER";
  return type;
}

std::string typed_form(const CLI::Option& option) {
  if (!option.nonpositional()) return option.get_name(true);
  const std::string name = option.get_name(false, true);
  return takes_value(option) ? name + " " + value_type(option).name : name;
}

std::string explanation(const CLI::Option& option, HelpLength length) {
  std::string text = option.get_description();
  if (length == HelpLength::Short) text = text.substr(0, text.find('\n'));
  std::vector<std::string> notes;
  if (option.get_required()) notes.emplace_back("required");
  if (const ValueType type = value_type(option); !type.range.empty()) notes.push_back(type.range);
  if (!option.get_default_str().empty()) notes.push_back("default: " + option.get_default_str());
  return notes.empty() ? text : fmt::format("{} [{}]", text, fmt::join(notes, "; "));
}

std::shared_ptr<CLI::FormatterBase> make_help_formatter() {
  return std::make_shared<HelpFormatter>();
}

}  // namespace lenticule::cli
