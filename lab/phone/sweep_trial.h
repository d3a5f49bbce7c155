// SPDX-License-Identifier: Apache-2.0
// SweepTrial calibrates a simulated workshop from a film that a phone takes while it is moved, and
// compares the result with the ground truth.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "calib/phone/film.h"
#include "lab/phone/workshop.h"

namespace lenticule::lab {

enum class HandOutcome {
  Right,    ///< accepted, and within the limit everywhere
  Refused,  ///< with a reason
  Wrong,    ///< accepted, but beyond the limit somewhere
};
[[nodiscard]] const char* to_string(HandOutcome outcome);

/// Largest error, in lenses, of a right result.
inline constexpr double kMostHandLenses = 0.02;

struct HandResult {
  int photographs = 0;
  HandOutcome outcome = HandOutcome::Refused;
  bool fitted = false;               ///< the fit gave a rig, accepted or not
  double error_lenses = 0.0;         ///< worst_error() of that rig
  double stated_lenses = 0.0;        ///< largest error that the calibration states
  std::vector<std::string> reasons;  ///< those of the verdict, then warnings
  double fit_seconds = 0.0;          ///< time of the joint fit
};

/// Returns a photograph in linear light, as a reader decodes its codes.
[[nodiscard]] calib::CameraPicture picture_of(const Photo& photo);

/// SweepTrial takes a film of one workshop and calibrates from it. Of the film, only three frames
/// at each of `shots` places are simulated, a tenth of a second apart.
class SweepTrial {
 public:
  /// With `pictures`, the frames are also stored in that folder as 000.jpg and so on, ten a second,
  /// with a dark frame after each place, and the rig of their chart, start.toml. Throws
  /// Error(Failed).
  SweepTrial(uint64_t seed, const WorkshopLimits& limits,
             const std::filesystem::path& pictures = {});
  SweepTrial(const SweepTrial&) = delete;
  SweepTrial& operator=(const SweepTrial&) = delete;

  [[nodiscard]] const Workshop& workshop() const { return workshop_; }
  [[nodiscard]] const calib::SinglePhotoChart& chart() const { return chart_; }
  /// Returns the frames with the places of their tags.
  [[nodiscard]] const std::vector<calib::FilmFrame>& frames() const { return frames_; }
  /// Returns the chosen frames, measured, with their motion.
  [[nodiscard]] const std::vector<calib::PhonePhoto>& chosen() const { return chosen_; }
  /// Calibrates from the chosen frames, or from changed ones.
  [[nodiscard]] HandResult calibrate() const { return calibrate(chosen_); }
  [[nodiscard]] HandResult calibrate(const std::vector<calib::PhonePhoto>& frames) const;

 private:
  Workshop workshop_;
  SheetShape sheet_;
  calib::SinglePhotoChart chart_;
  calib::Estimate focal_px_;
  std::string refusal_;  ///< why no frames were chosen; empty if some were
  std::vector<calib::FilmFrame> frames_;
  std::vector<calib::PhonePhoto> chosen_;
};

}  // namespace lenticule::lab
