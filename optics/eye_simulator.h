// SPDX-License-Identifier: Apache-2.0
// What an eye sees on a woven frame: the picture that the lens sheet shows to one place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "optics/model.h"

namespace lenticule::optics {

/// Borrowed 8-bit RGB pixels, row by row from the top.
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
  /// Output size; 0 = the panel's own pixel grid divided by 2.
  int width = 0;
  int height = 0;
  /// Lens spot sigma in lenses; negative = the rig's own.
  double spot_sigma_lenses = -1.0;
};

/// Samples the plane of the lenses on a regular grid; each sample shows, per channel, the subpixels
/// that its lens shows to `eye`, weighted by the lens spot, mixed in linear light (sRGB transfer).
/// Throws Error(Input) when the frame's size is not the panel's, or the eye is not in front of it.
[[nodiscard]] RgbPicture simulate_eye(const OpticalModel& model, RgbView woven, const Eye& eye,
                                      const EyeOptions& options = {});

/// The subpixel of row j and `channel` that lens `lens` shows to the eye: its pixel column, or -1
/// where the lens shows none on this panel. Nearest in phase.
[[nodiscard]] int seen_column(const OpticalModel& model, int64_t lens, int j, int channel,
                              const Eye& eye);

}  // namespace lenticule::optics
