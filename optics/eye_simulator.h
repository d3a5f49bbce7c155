// SPDX-License-Identifier: Apache-2.0
// Simulates the picture that an eye at one position sees through the lens sheet on a woven frame,
// and compares the phases that eyes see.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "optics/model.h"

namespace lenticule::optics {

/// RgbView refers to borrowed 8-bit RGB pixels, row by row from the top.
struct RgbView {
  const uint8_t* pixels = nullptr;
  int width = 0;
  int height = 0;
  size_t stride_bytes = 0;
};

struct RgbPicture {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  ///< width * height * 3
};

struct EyeOptions {
  /// Output size; 0 = half of the panel's pixel grid.
  int width = 0;
  int height = 0;
};

/// Returns the picture that `eye` sees. Samples the plane of the lenses on a regular grid. Each
/// sample mixes, per channel, the subpixels that its lens shows to `eye`, weighted by the lens
/// spot, in linear light (sRGB transfer). Throws Error(Input) when the frame's size differs from
/// the panel's, or the eye is not in front of the panel.
[[nodiscard]] RgbPicture simulate_eye(const OpticalModel& model, RgbView woven, const Eye& eye,
                                      const EyeOptions& options = {});

/// Returns the largest difference of the phases of two rigs over the first one's panel, each seen
/// by its own eye, in lenses and without whole ones.
[[nodiscard]] double largest_phase_difference(const Rig& a, const Eye& eye_a, const Rig& b,
                                              const Eye& eye_b);

}  // namespace lenticule::optics
