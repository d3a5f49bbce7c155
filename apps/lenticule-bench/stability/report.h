// SPDX-License-Identifier: Apache-2.0
// What a row of `lenticule bench stability` measured, and whether that is good enough.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace lenticule::player {

struct StabilityRow {
  std::string name{};      ///< for --row
  std::string stressed{};  ///< what is stressed, for people
  uint64_t samples = 0;
  std::string samples_are{};  ///< "rays", "subpixels"
  /// What must not happen at all, or not more often than allowed.
  uint64_t failures = 0;
  uint64_t failures_allowed = 0;
  std::string failures_are{};  ///< "wrong lenses"
  /// The largest error against the oracle; both zero where a row only counts.
  double worst = 0.0;
  double bound = 0.0;
  std::string unit{};  ///< of the error
  std::string note{};  ///< further figures; empty = none
};

/// A row that looked at nothing does not pass, nor does an error that is not a number.
[[nodiscard]] bool passes(const StabilityRow& row);

struct StabilityReport {
  bool full = false;
  double seconds = 0.0;
  std::vector<StabilityRow> rows{};
};

/// True if there are rows and all of them pass.
[[nodiscard]] bool passes(const StabilityReport& report);

[[nodiscard]] nlohmann::json to_json(const StabilityReport& report);
/// One line per row and one about all.
[[nodiscard]] std::string to_text(const StabilityReport& report);

}  // namespace lenticule::player
