// SPDX-License-Identifier: Apache-2.0
// Makes photographs of a panel under its sheet by the chief-ray model: each camera pixel gathers
// rays, each ray meets a lens, and each lens shows the place that the eye sees through it, blurred
// by its spot.
#pragma once

#include <cstdint>

#include "calib/camera.h"
#include "frames/frame.h"
#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::test {

struct PhotoStage {
  optics::Rig rig;  ///< ground truth
  int width = 1024;
  int height = 576;
  double focal_px = 1120.0;
  Vec3 eye_mm{20.0, -15.0, 700.0};
  double yaw_degrees = 0.0;
  double roll_degrees = 0.0;
  double distortion = 0.0;  ///< convention of PhotoPose
  double noise = 0.0;       ///< standard deviation as a share of full scale
  double gain = 0.8;        ///< light of a white panel
  double ambient = 0.01;
  int rays_per_side = 3;  ///< rays per camera pixel and side
  int blur_px = 0;        ///< half width of a box filter, applied twice in both directions
  bool eight_bits = true;
  uint32_t seed = 1;
};

/// Returns a rig of 27 inches, 3840 x 2160, about 1500 lenses.
[[nodiscard]] optics::Rig desk_rig();

[[nodiscard]] calib::CameraPicture photograph(const PhotoStage& stage,
                                              const frames::WovenFrame& shown);

/// Scales a frame smoothly to a part of the panel, as a viewer that fits pictures into its window
/// does.
[[nodiscard]] frames::WovenFrame scaled(const frames::WovenFrame& frame, double part);

}  // namespace lenticule::test
