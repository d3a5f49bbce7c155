// SPDX-License-Identifier: Apache-2.0
// StabilityRow is a measurement of `lenticule bench stability` with its limits.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace lenticule::bench {

struct StabilityRow {
  std::string name{};      ///< name for --row
  std::string stressed{};  ///< stressed property, for people
  uint64_t samples = 0;
  std::string samples_are{};  ///< "rays", "subpixels"
  /// Failures must not exceed the allowed number.
  uint64_t failures = 0;
  uint64_t failures_allowed = 0;
  std::string failures_are{};  ///< "wrong lenses"
  /// The largest error relative to the oracle, and its limit; both zero if the row only counts
  /// failures.
  double worst = 0.0;
  double bound = 0.0;
  std::string unit{};  ///< unit of the error
  std::string note{};  ///< further figures; empty = none
};

/// Returns true if the row is within its limits. A row without samples and an error that is NaN do
/// not pass.
[[nodiscard]] bool passes(const StabilityRow& row);

struct StabilityReport {
  bool full = false;
  double seconds = 0.0;
  std::vector<StabilityRow> rows{};
};

/// Returns true if there are rows and all of them pass.
[[nodiscard]] bool passes(const StabilityReport& report);

[[nodiscard]] nlohmann::json to_json(const StabilityReport& report);
/// Returns one line per row and a summary line.
[[nodiscard]] std::string to_text(const StabilityReport& report);

}  // namespace lenticule::bench
