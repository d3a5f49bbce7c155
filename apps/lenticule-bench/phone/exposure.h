// SPDX-License-Identifier: Apache-2.0
// Exposes the sensor of a phone to a panel: the rays of its pixels reach lit pixels through the
// lens sheet, and the sensor adds its noise.
#pragma once

#include <vector>

#include "apps/lenticule-bench/phone/lens_section.h"
#include "apps/lenticule-bench/phone/phone_photo.h"
#include "frames/frame.h"

namespace lenticule::bench {

inline constexpr float kWallLight = 0.03F;  ///< light of the wall around the panel

/// SensorWindow is the part of the sensor on which the panel appears, in pixels.
struct SensorWindow {
  int left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] int width() const { return right - left; }
  [[nodiscard]] int height() const { return bottom - top; }
};

/// Mosaic is the linear light of each pixel of a window, in its own channel.
struct Mosaic {
  SensorWindow window;
  std::vector<float> light;
};

/// Returns the channel of a pixel of the sensor's mosaic: RGGB.
inline int mosaic_channel(int i, int j) {
  return j % 2 == 0 ? i % 2 : 1 + i % 2;
}

/// Returns the exposure of the pixels near the panel that shows `shown` (RGB codes, sRGB).
[[nodiscard]] Mosaic expose(const LensSection& sheet, const frames::FrameView& shown,
                            const Phone& phone, const Shot& shot);

}  // namespace lenticule::bench
