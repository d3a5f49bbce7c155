// SPDX-License-Identifier: Apache-2.0
// Texture look-up, one colour channel at a time, and storage of textures in a quarter of the
// memory.
#pragma once

#include <array>
#include <cstddef>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Returns component 0, 1 or 2 of a colour: the value that a subpixel of that channel needs.
[[nodiscard]] inline double component(const Vec3& colour, int channel) {
  return channel == 0 ? colour.x : channel == 1 ? colour.y : colour.z;
}

/// Returns true if the texture has texels, and as many as its size states.
[[nodiscard]] bool is_complete(const Texture& texture);

/// Returns the light of the 256 codes of a colour, rounded as float textures are.
[[nodiscard]] const std::array<float, 256>& light_of_codes();

/// Returns a channel of a texel as linear light; `texel` counts row by row. Alpha is channel 3.
[[nodiscard]] double texel_light(const Texture& texture, size_t texel, int channel);

/// Interpolates bilinearly between texel centres; (0, 0) is the top-left corner of the picture.
/// Outside the picture, the texture repeats, plainly or mirrored, or its border is extended, as the
/// texture states. A non-finite coordinate counts as 0.
[[nodiscard]] double texture_value(const Texture& texture, double u, double v, int channel);

/// Returns true if two textures are equal. Frames of one file share their textures; frames of
/// separate files have equal copies. Two null pointers are equal.
[[nodiscard]] bool same_texture(const std::shared_ptr<const Texture>& a,
                                const std::shared_ptr<const Texture>& b);

/// Replaces Texture::rgba by Texture::codes if that loses nothing: if each number is that of an
/// 8-bit code. The codes of colours are sRGB-encoded, those of other data are fractions of 255.
/// Returns true if the texture has codes afterwards.
bool keep_codes(Texture& texture, bool is_colour);

}  // namespace lenticule::render
