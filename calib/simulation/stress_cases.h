// SPDX-License-Identifier: Apache-2.0
// What goes wrong before real panels, one thing at a time, and what a calibration must make of it:
// the cases of `lenticule bench calibrate --stress`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calib/simulation/trial.h"

namespace lenticule::calib {

/// Small ones take seconds together, full ones a minute each.
enum class StressSize { Small, Full };

enum class StressDemand {
  Good,            ///< an intrinsic rig within the limits
  Detected,        ///< something that is said names it
  GoodOrDetected,  ///< an intrinsic rig within the limits, or none that calls itself intrinsic
};

/// What an intrinsic rig is held to; for a single photograph, an effective one.
struct StressLimits {
  double flat_lenses = 0.02;   ///< TrialErrors::flat_lenses of the first viewpoint
  double worst_lenses = 0.02;  ///< TrialErrors::worst_lenses
  double pitch = 1e-5;         ///< TrialErrors::effective_pitch of the first viewpoint
  double map_rms_lenses = 1.0;
};

struct StressCase {
  std::string name;  ///< for --only
  int row = 0;       ///< of the list of cases in docs/calibration.md
  std::string what;  ///< is stressed, for people
  Trial (*trial)(StressSize size);
  StressDemand demand = StressDemand::Good;
  StressLimits limits{};   ///< at full size
  std::string named_by{};  ///< a part of the sentence that detects it
  bool single_photo = false;
  /// Why the demand is not met today, though nothing wrong is trusted; empty where it is.
  std::string shortfall{};
};

/// Every case, in the order of the table; names are unique.
[[nodiscard]] const std::vector<StressCase>& stress_cases();

/// Full size: the limits of the case. Small size: noise weighs more there. At each place of the
/// panel it grows as the camera's columns get fewer, which is the root of how many pixels there are
/// to average; the limits of evenness and map grow by that, the former to 0.02 lens at most. Of the
/// pitch phases tell less still where there are fewer lenses: its limit grows by that ratio too.
[[nodiscard]] StressLimits limits_at(const StressCase& one, StressSize size);

struct StressOutcome {
  std::string verdict;  ///< "intrinsic", "effective", "refused", "failed"
  std::string said;     ///< failure, reasons, warnings and findings
  double pitch = 0.0;   ///< as StressLimits::pitch
  double flat_lenses = 0.0;
  TrialErrors errors;    ///< meaningful unless `measured` is false
  bool measured = true;  ///< false after a failure and where no rig could be fitted
  bool good = false;     ///< trusted, and within the limits
  bool wrong = false;    ///< trusted, and off by more than a viewer tolerates
  bool named = false;    ///< something that is said names it
  bool held = false;     ///< the demand is met
  double seconds = 0.0;
};

/// `go_on` is asked before each pattern; false ends the case, which then fails "interrupted".
[[nodiscard]] StressOutcome run_stress_case(const StressCase& one, StressSize size,
                                            const std::function<bool()>& go_on);

}  // namespace lenticule::calib
