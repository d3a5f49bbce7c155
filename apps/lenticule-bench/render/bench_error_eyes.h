// SPDX-License-Identifier: Apache-2.0
// ErrorEyes measures the visible difference of two woven frames for eyes at three places.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "frames/frame.h"
#include "frames/measures/flicker.h"
#include "frames/measures/flip.h"
#include "frames/sequence/band_workers.h"
#include "optics/model.h"

namespace lenticule::bench {

/// The eyes are in the middle of the viewing zone and a third of the zone to each side, from left
/// to right.
inline constexpr int kErrorEyes = 3;
using SeenPictures = std::array<frames::WovenFrame, kErrorEyes>;
/// The meters of one method in one scenario.
using EyeFlicker = std::array<frames::FlickerMeter, kErrorEyes>;

/// Returns the pixels of frames::decoded_geometry() per degree, in front of the panel at the
/// viewing distance; FLIP's default if that is infinite. Clamped to FLIP's range.
[[nodiscard]] double seen_pixels_per_degree(const optics::Rig& rig);

class ErrorEyes {
 public:
  /// Lifetime: both must outlive this object.
  ErrorEyes(const optics::OpticalModel& model, frames::BandWorkers& workers);

  /// Sets the frame with which the next ones are compared.
  void set_reference(const frames::FrameView& woven);
  /// Returns one entry per eye: {"ssim" (null for tiny pictures), "flip_mean", "flip_p99",
  /// "flicker_mean", "flicker_largest"}.
  [[nodiscard]] nlohmann::json compare(const frames::FrameView& woven, EyeFlicker& flicker);

  [[nodiscard]] const SeenPictures& reference() const { return reference_; }
  /// Returns the pictures of the last compare().
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

}  // namespace lenticule::bench
