// SPDX-License-Identifier: Apache-2.0
// Camera movements of built-in scenes.
#pragma once

#include <cmath>
#include <numbers>

#include "scenes/elements.h"

namespace lenticule::scenes {

[[nodiscard]] inline Vec3 turned_about_z(Vec3 p, double radians) {
  const double c = std::cos(radians);
  const double s = std::sin(radians);
  return {c * p.x - s * p.y, s * p.x + c * p.y, p.z};
}

/// Returns the angle of a frame within a full turn, in radians. The turn is closed: the frame after
/// the last equals the first.
[[nodiscard]] inline double turn_of(int frame, int frames) {
  return 2.0 * std::numbers::pi * frame / frames;
}

/// Rotates the camera of frame 0 once around the vertical axis (z) through the origin; meanwhile it
/// rises and sinks `waves` times by `rise`.
[[nodiscard]] inline View turned_view(View view, int frame, int frames, double rise = 0.0,
                                      int waves = 1) {
  const double angle = turn_of(frame, frames);
  view.from = turned_about_z(view.from, angle);
  view.from.z += rise * std::sin(waves * angle);
  view.at = turned_about_z(view.at, angle);
  return view;
}

}  // namespace lenticule::scenes
