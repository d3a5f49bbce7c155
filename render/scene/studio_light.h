// SPDX-License-Identifier: Apache-2.0
// The studio: light of our own for models whose file has no lights. docs/render/shading.md states
// the formula.
#pragma once

#include "optics/vec.h"

namespace lenticule::render {

/// Returns the light from a direction of the studio, a grey room with soft boxes. x is to the right
/// of the viewer, y up, and z points to the viewer; `direction` is unit. A white matt surface that
/// faces the viewer appears with a light of 1.
[[nodiscard]] double studio_light(Vec3 direction);

/// Background of the studio, as shown: a light neutral grey.
inline constexpr Vec3 kStudioBackground{0.80, 0.80, 0.80};

}  // namespace lenticule::render
