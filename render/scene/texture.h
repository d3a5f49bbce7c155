// SPDX-License-Identifier: Apache-2.0
// Texture look-up, one colour channel at a time.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Component 0, 1, 2 of a colour: what a subpixel of that channel needs of it.
[[nodiscard]] inline double component(const Vec3& colour, int channel) {
  return channel == 0 ? colour.x : channel == 1 ? colour.y : colour.z;
}

/// Bilinear between texel centres; (0, 0) is the top-left corner of the picture. Beyond it, the
/// texture repeats or its border continues, as it says. A coordinate that is not finite is 0.
[[nodiscard]] double texture_value(const Texture& texture, double u, double v, int channel);

/// Frames of one file share their textures; others have equal ones. Null is the same as null.
[[nodiscard]] bool same_texture(const std::shared_ptr<const Texture>& a,
                                const std::shared_ptr<const Texture>& b);

}  // namespace lenticule::render
