// SPDX-License-Identifier: Apache-2.0
// Computes the view under a subpixel as Looking Glass programs do: holoplay-core 0.0.11 with the
// numbers of looking-glass-webxr 0.6, and the Unity SDK's handling of flipSubp and invView, which
// those two do not read.
#pragma once

#include <array>
#include <cmath>

namespace lenticule::test {

/// Offsets x, y (upward, in pixels) of R, G and B.
using LookingGlassCell = std::array<std::array<double, 2>, 3>;

struct LookingGlassFile {
  double width, height;
  double pitch, slope, center, dpi;
  bool flip_x, flip_subpixels, inverted;
};

namespace looking_glass {

inline double fract(double value) { return value - std::floor(value); }
inline double pitch_of(const LookingGlassFile& f) {
  return f.pitch * f.width / f.dpi * std::cos(std::atan(1.0 / f.slope));
}
inline double tilt_of(const LookingGlassFile& f) {
  return f.height / (f.width * f.slope) * (f.flip_x ? -1.0 : 1.0);
}
inline double subp_of(const LookingGlassFile& f) {
  return 1.0 / (3.0 * f.width) * (f.flip_x ? -1.0 : 1.0);
}

/// Returns which cell a pixel has; y counts from the bottom.
inline size_t cell_index(int mode, int x, int y) {
  switch (mode) {
    case 1:
      return static_cast<size_t>((x + y) % 2);
    case 2:
      return static_cast<size_t>(x % 2);
    case 3:
      return static_cast<size_t>((y + 2 * (x % 2)) % 4);
    case 4:
      return static_cast<size_t>(y % 2);
    default:
      return 0;
  }
}

/// Returns the lens coordinate of a stripe, before it is wrapped. Pixel (i, j) counts from the top
/// left.
inline double stripe_coordinate(const LookingGlassFile& f, int i, int j, int channel) {
  const double u = (i + 0.5) / f.width, v = (f.height - 1 - j + 0.5) / f.height;
  const int stripe = f.flip_subpixels ? 2 - channel : channel;
  return (u + stripe * subp_of(f) + v * tilt_of(f)) * pitch_of(f) - f.center;
}

/// Returns the place among the views, 0 to 1, of a stripe; the view is floor(place * views).
inline double stripe_view(const LookingGlassFile& f, int i, int j, int channel) {
  const double place = fract(stripe_coordinate(f, i, j, channel));
  return f.inverted ? 1.0 - place : place;
}

/// Returns the same for a panel with cells.
inline double cell_view(const LookingGlassFile& f, const LookingGlassCell& cell, int i, int j,
                        int channel) {
  const auto& offset = cell[static_cast<size_t>(channel)];
  const double u = (i + 0.5 + offset[0]) / f.width;
  const double v = (f.height - 1 - j + 0.5 + offset[1]) / f.height;
  return 1.0 - fract((u + v * tilt_of(f)) * pitch_of(f) - f.center);
}

}  // namespace looking_glass
}  // namespace lenticule::test
