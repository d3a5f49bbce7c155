// SPDX-License-Identifier: Apache-2.0
// One cylinder lens and the layers under it, hit by one ray. Coordinates of a lens: u across it
// from its apex line, v along the apex line, z toward the viewer with the apex at 0; millimetres.
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

/// Direction behind a surface with unit `normal` (against the ray), from index n1 into n2, with
/// ratio = n1 / n2: vector form of Snell's law. None if the light is totally reflected.
[[nodiscard]] std::optional<Vec3> refract(Vec3 direction, Vec3 normal, double ratio);

/// Where a ray from above lands on the plane of the pixels. `start` is where it would cross the
/// plane z = 0 if nothing bent it, with |start.x| up to half a pitch (a neighbour's surface is
/// tried where the ray misses the lens); `direction` has length 1 and z < 0. None if no light
/// passes.
[[nodiscard]] std::optional<Vec2> land(const LensStack& stack, Vec2 start, Vec3 direction);

/// A ray to the lens surface at height `u`, v = 0, from a far point.
struct ApertureRay {
  Vec2 landing;
  double weight = 0.0;  ///< of an equal step of u, as large as the far point sees it
};
/// `eye` in the coordinates of the lens, z > 0. None if no light passes.
[[nodiscard]] std::optional<ApertureRay> aperture_ray(const LensStack& stack, double u, Vec3 eye);

/// The point of the plane z = 0 that `eye` looks straight at while its light reaches the apex at
/// the origin: the origin itself, unless there is a slab above the apices.
[[nodiscard]] Vec2 straight_aim(const LensStack& stack, Vec3 eye);

}  // namespace lenticule::calib
