// SPDX-License-Identifier: Apache-2.0
// Values of a texture, however it stores them.
#pragma once

#include <vector>

#include "frames/image_io.h"
#include "render/scene/scene_description.h"

namespace lenticule::test {

/// Returns four values for each texel, rows from the top: linear light of colours, fractions of
/// data.
inline std::vector<float> texels_of(
    const render::Texture& texture,
    frames::TextureContent content = frames::TextureContent::Colour) {
  return frames::floats_of({texture.width, texture.height, texture.rgba, texture.codes}, content)
      .rgba;
}

}  // namespace lenticule::test
