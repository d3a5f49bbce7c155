// SPDX-License-Identifier: Apache-2.0
// WrongWay is a mistake that people make with photographs for a calibration. WrongWayTrial makes it
// in a simulated workshop and calibrates as `lenticule calibrate photos` does.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "apps/lenticule-bench/calibrate/hand_trial.h"
#include "base/temporary.h"

namespace lenticule::bench {

/// Taking is what a photograph depends on.
struct Taking {
  SheetBuild build;
  Phone phone;
  Shot shot;
  optics::Rig shown;  ///< the rig whose chart the panel shows
  double chart_scale = 1.0;
};

struct WrongWay {
  std::string name;    ///< the mistake in words, for tables
  std::string causes;  ///< words of which a refusal must have one, separated by '|'
  bool all = false;    ///< true if all photographs are wrong; else only the last one is
  void (*before)(Taking&, const Workshop&) = nullptr;  ///< changes how the photograph is taken
  void (*after)(Photo&) = nullptr;                     ///< changes the photograph
};

/// Returns the mistakes.
[[nodiscard]] std::span<const WrongWay> wrong_ways();

struct WrongWayResult {
  HandOutcome outcome = HandOutcome::Refused;
  bool cause_named = false;  ///< true if a refusal has one of the way's causes
  double error_lenses = 0.0;
  std::string reason;  ///< the first; empty if the calibration was accepted
};

/// WrongWayTrial takes three photographs of one workshop for each mistake. Photographs without one
/// are taken once.
class WrongWayTrial {
 public:
  /// Stores photographs in a folder of its own inside `parent`. Throws Error(Failed).
  WrongWayTrial(uint64_t seed, const WorkshopLimits& limits, const std::filesystem::path& parent);

  /// Throws Error(Failed) if a photograph cannot be stored.
  [[nodiscard]] WrongWayResult calibrate(const WrongWay& way);

 private:
  [[nodiscard]] std::filesystem::path photograph_of(size_t number, const optics::Rig& shown,
                                                    const WrongWay* way);

  Workshop workshop_;
  LensSection sheet_;
  TemporaryFolder folder_;
};

}  // namespace lenticule::bench
