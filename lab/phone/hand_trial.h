// SPDX-License-Identifier: Apache-2.0
// HandTrial calibrates a simulated workshop from photographs taken by hand and compares the result
// with the ground truth; WrongWayTrial does so with one of the mistakes that people make.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/temporary.h"
#include "lab/phone/sweep_trial.h"

namespace lenticule::tools {
class HandHeldPhotos;
}

namespace lenticule::lab {

/// HandTrial takes the photographs of one workshop and measures each once.
class HandTrial {
 public:
  static constexpr double kMostLenses = kMostHandLenses;

  /// With `pictures`, the photographs are also stored in that folder as 1.jpg and so on, with the
  /// rig of their chart, start.toml. Throws Error(Failed).
  HandTrial(uint64_t seed, const WorkshopLimits& limits, std::filesystem::path pictures = {});
  HandTrial(const HandTrial&) = delete;
  HandTrial& operator=(const HandTrial&) = delete;

  [[nodiscard]] const Workshop& workshop() const { return workshop_; }
  [[nodiscard]] const calib::SinglePhotoChart& chart() const { return chart_; }
  [[nodiscard]] const std::vector<calib::PhonePhoto>& photos() const& { return photos_; }
  const std::vector<calib::PhonePhoto>& photos() const&& = delete;
  [[nodiscard]] const calib::Estimate& focal_px() const { return focal_px_; }

  /// Returns the largest phase error of a rig over the panel, for the judged eyes.
  [[nodiscard]] double error_of(const optics::Rig& rig) const;
  /// Calibrates from the first photographs. The rig of a single one is valid only where it was
  /// taken, and is judged there.
  [[nodiscard]] HandResult calibrate(int photographs) const;

 private:
  void take(const Shot& shot);

  std::filesystem::path pictures_;
  Workshop workshop_;
  SheetShape sheet_;
  calib::SinglePhotoChart chart_;
  calib::CameraPicture first_picture_;
  std::vector<calib::PhonePhoto> photos_;
  calib::Estimate focal_px_;
};

// WrongWay is a mistake that people make with photographs for a calibration. WrongWayTrial makes it
// in a simulated workshop and calibrates as `lenticule calibrate photos` does.

/// Taking is what a photograph depends on.
struct Taking {
  optics::Panel panel;
  SimulatedSheet build;
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
  std::string blamed;        ///< the cause that a refusal names, in a few words for tables
  double error_lenses = 0.0;
  std::string reason;  ///< the first; empty if the calibration was accepted
};

/// WrongWayTrial takes three photographs of one workshop for each mistake. Photographs without one
/// are taken once.
class WrongWayTrial {
 public:
  /// Stores photographs in a folder of its own inside `parent`. Throws Error(Failed).
  WrongWayTrial(uint64_t seed, const WorkshopLimits& limits, const std::filesystem::path& parent);
  ~WrongWayTrial();

  /// Throws Error(Failed) if a photograph cannot be stored.
  [[nodiscard]] WrongWayResult calibrate(const WrongWay& way);

 private:
  /// Adds all photographs but the last, with a mistake unless `way` is null.
  [[nodiscard]] tools::HandHeldPhotos begin(const WrongWay* way, std::string& reason);
  [[nodiscard]] std::filesystem::path photograph_of(size_t number, const optics::Rig& shown,
                                                    const WrongWay* way);

  Workshop workshop_;
  SheetShape sheet_;
  TemporaryFolder folder_;
  std::unique_ptr<tools::HandHeldPhotos> right_;  ///< without a mistake, all but the last
  std::string right_reason_;                      ///< why one of them cannot be used
};
}  // namespace lenticule::lab
