// SPDX-License-Identifier: Apache-2.0
// How far apart two woven frames look to eyes in three places.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "frames/frame.h"
#include "frames/measures/flicker.h"
#include "frames/measures/flip.h"
#include "frames/sequence/band_workers.h"
#include "optics/model.h"

namespace lenticule::player {

/// In the middle of the viewing zone, and a third of it to either side; from the left.
inline constexpr int kErrorEyes = 3;
using SeenPictures = std::array<frames::WovenFrame, kErrorEyes>;
/// Of one method in one course.
using EyeFlicker = std::array<frames::FlickerMeter, kErrorEyes>;

/// Pixels of frames::decoded_geometry() in a degree, in front of the panel at the viewing distance;
/// FLIP's own where that is infinite. Held within what FLIP takes.
[[nodiscard]] double seen_pixels_per_degree(const optics::Rig& rig);

class ErrorEyes {
 public:
  /// Both must outlive it.
  ErrorEyes(const optics::OpticalModel& model, frames::BandWorkers& workers);

  /// What the next frames are compared with.
  void set_reference(const frames::FrameView& woven);
  /// One entry per eye: {"ssim" (null for tiny pictures), "flip_mean", "flip_p99", "flicker_mean",
  /// "flicker_largest"}.
  [[nodiscard]] nlohmann::json compare(const frames::FrameView& woven, EyeFlicker& flicker);

  [[nodiscard]] const SeenPictures& reference() const { return reference_; }
  /// Of the last compare().
  [[nodiscard]] const SeenPictures& test() const { return test_; }

 private:
  [[nodiscard]] frames::WovenFrame seen(const frames::FrameView& woven, int eye) const;

  const optics::OpticalModel& model_;
  frames::BandWorkers& workers_;
  double pixels_per_degree_;
  SeenPictures reference_;
  std::vector<frames::FlipPicture> reference_flip_;
  SeenPictures test_;
};

}  // namespace lenticule::player
