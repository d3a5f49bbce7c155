// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/stability/report.h"

#include <fmt/format.h>

#include <algorithm>

namespace lenticule::bench {
namespace {

/// Returns 12345678 as "12 345 678".
std::string grouped(uint64_t number) {
  if (number < 1000) return fmt::format("{}", number);
  return fmt::format("{} {:03}", grouped(number / 1000), number % 1000);
}

std::string error_text(const StabilityRow& row) {
  if (row.unit.empty()) return {};
  return fmt::format("; error {:.2g} of {:.2g} {}", row.worst, row.bound, row.unit);
}

std::string failures_text(const StabilityRow& row) {
  std::string text = fmt::format("{} {}", grouped(row.failures), row.failures_are);
  if (row.failures_allowed > 0) text += fmt::format(" of {}", grouped(row.failures_allowed));
  return text;
}

size_t longest_name(const StabilityReport& report) {
  size_t longest = 0;
  for (const StabilityRow& row : report.rows) longest = std::max(longest, row.name.size());
  return longest;
}

}  // namespace

bool passes(const StabilityRow& row) {
  return row.samples > 0 && row.failures <= row.failures_allowed && row.worst <= row.bound;
}

bool passes(const StabilityReport& report) {
  return !report.rows.empty() &&
         std::ranges::all_of(report.rows, [](const StabilityRow& row) { return passes(row); });
}

nlohmann::json to_json(const StabilityReport& report) {
  nlohmann::json rows = nlohmann::json::array();
  for (const StabilityRow& row : report.rows)
    rows.push_back({{"name", row.name},
                    {"stressed", row.stressed},
                    {"samples", row.samples},
                    {"samples_are", row.samples_are},
                    {"failures", row.failures},
                    {"failures_allowed", row.failures_allowed},
                    {"failures_are", row.failures_are},
                    {"worst", row.worst},
                    {"bound", row.bound},
                    {"unit", row.unit},
                    {"note", row.note},
                    {"passes", passes(row)}});
  return {{"benchmark", "stability"},
          {"size", report.full ? "full" : "quick"},
          {"seconds", report.seconds},
          {"rows", rows},
          {"passes", passes(report)}};
}

std::string to_text(const StabilityReport& report) {
  const size_t width = longest_name(report);
  std::string text;
  uint64_t passed = 0;
  for (const StabilityRow& row : report.rows) {
    text += fmt::format("{} {:<{}}  {} {}: {}{}\n", passes(row) ? "pass" : "FAIL", row.name, width,
                        grouped(row.samples), row.samples_are, failures_text(row), error_text(row));
    text += fmt::format("{:{}}  {}\n", "", width + 5, row.stressed);
    if (!row.note.empty()) text += fmt::format("{:{}}  {}\n", "", width + 5, row.note);
    if (passes(row)) ++passed;
  }
  return text +
         fmt::format("{} of {} rows pass, {:.0f} s\n", passed, report.rows.size(), report.seconds);
}

}  // namespace lenticule::bench
