// SPDX-License-Identifier: Apache-2.0
// The sample points of soft light once more, one at a time, in double precision and bit by bit: the
// oracle of render/sampling/, with which it shares no code.
#pragma once

#include <cstdint>

#include "optics/vec.h"

namespace lenticule::testing {

/// Of the eye's rays; mirrored and refracted ones have others.
inline constexpr uint32_t kReferencePath = 1;
[[nodiscard]] uint32_t reference_path(uint32_t path, bool refracted);

/// What sets a subpixel (3 i + channel of a row) apart.
[[nodiscard]] uint32_t reference_seed(int row, int subpixel, int sample);

/// Both coordinates in [0, 1).
struct SquarePoint {
  double u = 0.0;
  double v = 0.0;
};
/// Point `index` of what a subpixel takes for one use: 0 is ambient light, 1 + n light n.
[[nodiscard]] SquarePoint reference_point(uint32_t seed, uint32_t path, uint32_t use,
                                          uint32_t index);

/// On the unit disc, z = 0.
[[nodiscard]] Vec3 reference_on_disc(SquarePoint point);
/// `across`, whose z is zero, turned so that z points along `axis` (unit).
[[nodiscard]] Vec3 reference_turned(Vec3 across, Vec3 axis);
/// A unit direction about `axis`, cosine-weighted.
[[nodiscard]] Vec3 reference_cosine_direction(SquarePoint point, Vec3 axis);

}  // namespace lenticule::testing
