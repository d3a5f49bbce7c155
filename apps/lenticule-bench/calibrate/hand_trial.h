// SPDX-License-Identifier: Apache-2.0
// HandTrial calibrates a simulated workshop from photographs taken by hand and compares the result
// with the ground truth.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/lenticule-bench/phone/workshop.h"
#include "calib/phone/phone_calibration.h"

namespace lenticule::bench {

enum class HandOutcome {
  Right,    ///< accepted, and within the limit everywhere
  Refused,  ///< with a reason
  Wrong,    ///< accepted, but beyond the limit somewhere
};
[[nodiscard]] const char* to_string(HandOutcome outcome);

struct HandResult {
  int photographs = 0;
  HandOutcome outcome = HandOutcome::Refused;
  bool fitted = false;         ///< the fit gave a rig, accepted or not
  double error_lenses = 0.0;   ///< worst_error() of that rig
  double stated_lenses = 0.0;  ///< largest error that the calibration states
  std::vector<std::string> reasons;
  double fit_seconds = 0.0;  ///< time of the joint fit
};

/// HandTrial takes the photographs of one workshop and measures each once.
class HandTrial {
 public:
  /// Largest error, in lenses, of a right result.
  static constexpr double kMostLenses = 0.02;

  HandTrial(uint64_t seed, const WorkshopLimits& limits);
  HandTrial(const HandTrial&) = delete;
  HandTrial& operator=(const HandTrial&) = delete;

  [[nodiscard]] const Workshop& workshop() const { return workshop_; }
  [[nodiscard]] const calib::SinglePhotoChart& chart() const { return chart_; }
  [[nodiscard]] const std::vector<calib::PhonePhoto>& photos() const { return photos_; }
  [[nodiscard]] const calib::Estimate& focal_px() const { return focal_px_; }

  /// Returns the largest phase error of a rig over the panel, for the judged eyes.
  [[nodiscard]] double error_of(const optics::Rig& rig) const;
  /// Calibrates from the first photographs. The rig of a single one is valid only where it was
  /// taken, and is judged there.
  [[nodiscard]] HandResult calibrate(int photographs) const;

 private:
  void take(const Shot& shot);
  [[nodiscard]] HandResult calibrate_single() const;

  Workshop workshop_;
  LensSection sheet_;
  calib::SinglePhotoChart chart_;
  calib::CameraPicture first_picture_;
  std::vector<calib::PhonePhoto> photos_;
  calib::Estimate focal_px_;
};

}  // namespace lenticule::bench
