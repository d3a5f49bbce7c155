// SPDX-License-Identifier: Apache-2.0
// The stress cases of `lenticule bench calibrate --stress`: each case has one fault of a real
// setup, and the result that a calibration must give.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lab/panel/trial.h"

namespace lenticule::lab {

/// Small cases take seconds in total, full cases a minute each.
enum class StressSize { Small, Full };

enum class StressDemand {
  Good,            ///< an intrinsic rig within the limits
  Detected,        ///< a message names the fault
  GoodOrDetected,  ///< an intrinsic rig within the limits, or a rig that does not claim to be
                   ///< intrinsic
};

/// Limits of an intrinsic rig; for a single photograph, of an effective rig.
struct StressLimits {
  double flat_lenses = 0.02;   ///< TrialErrors::flat_lenses of the first viewpoint
  double worst_lenses = 0.02;  ///< TrialErrors::worst_lenses
  double pitch = 1e-5;         ///< TrialErrors::effective_pitch of the first viewpoint
  double map_rms_lenses = 1.0;
};

struct StressCase {
  std::string name;  ///< name for --only
  int row = 0;       ///< number of the case, as `bench calibrate --stress` prints it
  std::string what;  ///< the tested fault, for people
  void (*change)(Trial& trial, bool full);  ///< adds the fault to a trial without one
  StressDemand demand = StressDemand::Good;
  StressLimits limits{};   ///< limits at full size
  std::string named_by{};  ///< a part of the sentence that names the fault
  bool single_photo = false;
  /// Reason why the demand is not met today, although no wrong result is trusted; empty if it is
  /// met.
  std::string shortfall{};
};

/// Returns every case, in the order of the table; names are unique.
[[nodiscard]] const std::vector<StressCase>& stress_cases();

[[nodiscard]] Trial trial_of(const StressCase& one, StressSize size);

/// Returns the limits at a size. Full size: the limits of the case. Small size: noise has a larger
/// effect. At each panel position it grows in inverse proportion to the camera's columns, which is
/// the root of the number of averaged pixels. The limits of evenness and map grow by this ratio,
/// the former to at most 0.02 lens. Fewer lenses determine the pitch still less, so its limit grows
/// by their ratio too.
[[nodiscard]] StressLimits limits_at(const StressCase& one, StressSize size);

struct StressOutcome {
  std::string verdict;  ///< "intrinsic", "effective", "refused", "failed"
  std::string said;     ///< failure, reasons, warnings and findings
  double pitch = 0.0;   ///< same error as StressLimits::pitch
  double flat_lenses = 0.0;
  TrialErrors errors;    ///< valid only if `measured` is true
  bool measured = true;  ///< false after a failure and if no rig could be fitted
  bool good = false;     ///< trusted, and within the limits
  bool wrong = false;    ///< trusted, and off by more than a viewer tolerates
  bool named = false;    ///< a message names the fault
  bool held = false;     ///< the demand is met
  double seconds = 0.0;
};

/// Runs one case. `may_continue` is called before each pattern; if it returns false, the case fails
/// with "interrupted".
[[nodiscard]] StressOutcome run_stress_case(const StressCase& one, StressSize size,
                                            const std::function<bool()>& may_continue);

}  // namespace lenticule::lab
