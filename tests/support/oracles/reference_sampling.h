// SPDX-License-Identifier: Apache-2.0
// Reference implementation of the sample points of soft light, one at a time, in double precision
// and bit by bit. It shares no code with render/sampling/.
#pragma once

#include <cstdint>

#include "optics/vec.h"

namespace lenticule::test {

/// Path id of the eye's rays; mirrored and refracted rays have others.
inline constexpr uint32_t kReferencePath = 1;
[[nodiscard]] uint32_t reference_path(uint32_t path, bool refracted);

/// Returns the seed of a subpixel (3 i + channel of a row).
[[nodiscard]] uint32_t reference_seed(int row, int subpixel, int sample);

/// A point with both coordinates in [0, 1).
struct SquarePoint {
  double u = 0.0;
  double v = 0.0;
};
/// Returns point `index` of a subpixel for one use: 0 is ambient light, 1 + n light n.
[[nodiscard]] SquarePoint reference_point(uint32_t seed, uint32_t path, uint32_t use,
                                          uint32_t index);

/// Maps the point to the unit disc, z = 0.
[[nodiscard]] Vec3 reference_on_disc(SquarePoint point);
/// Rotates `across`, whose z is zero, so that z points along `axis` (unit).
[[nodiscard]] Vec3 reference_turned(Vec3 across, Vec3 axis);
/// Returns a unit direction about `axis`, cosine-weighted.
[[nodiscard]] Vec3 reference_cosine_direction(SquarePoint point, Vec3 axis);

}  // namespace lenticule::test
