// SPDX-License-Identifier: Apache-2.0
// Storage of textures in a quarter of the memory.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Replaces Texture::rgba by Texture::codes if that loses nothing: if each number is that of an
/// 8-bit code. The codes of colours are sRGB-encoded, those of other data are fractions of 255.
/// Returns true if the texture has codes afterwards.
bool keep_codes(Texture& texture, bool is_colour);

}  // namespace lenticule::render
