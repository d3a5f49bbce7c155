// SPDX-License-Identifier: Apache-2.0
// Traces one ray through one cylinder lens and the layers under it. Coordinates of a lens: u across
// it from its apex line, v along the apex line, z toward the viewer with the apex at 0;
// millimetres.
#pragma once

#include <optional>

#include "optics/vec.h"

namespace lenticule::calib {

struct LensStack {
  double pitch_mm = 0.0;  ///< width of a lens, across it
  double radius_mm = 0.0;
  double thickness_mm = 0.0;
  double air_gap_mm = 0.0;
  double index = 1.5;
  bool lens_toward_panel = false;
};

/// Returns the direction behind a surface with unit `normal` (against the ray), from index n1 into
/// n2, with ratio = n1 / n2: vector form of Snell's law. Returns nothing on total reflection.
[[nodiscard]] std::optional<Vec3> refract(Vec3 direction, Vec3 normal, double ratio);

/// Returns the landing point of a ray from above on the plane of the pixels. `start` is the point
/// where the unrefracted ray would cross the plane z = 0, with |start.x| up to half a pitch (a
/// neighbour's surface is tried if the ray misses the lens); `direction` has length 1 and z < 0.
/// Returns nothing if no light passes.
[[nodiscard]] std::optional<Vec2> land(const LensStack& stack, Vec2 start, Vec3 direction);

/// ApertureRay is a ray to the lens surface at height `u`, v = 0, from a far point.
struct ApertureRay {
  Vec2 landing;
  double weight =
      0.0;  ///< weight of an equal step of u, proportional to its size as seen from the far point
};
/// Traces a ray from `eye`, in the coordinates of the lens, z > 0. Returns nothing if no light
/// passes.
[[nodiscard]] std::optional<ApertureRay> aperture_ray(const LensStack& stack, double u, Vec3 eye);

/// Returns the point of the plane z = 0 in the straight direction from `eye` whose light reaches
/// the apex at the origin: the origin itself, unless there is a slab above the apices.
[[nodiscard]] Vec2 straight_aim(const LensStack& stack, Vec3 eye);

}  // namespace lenticule::calib
