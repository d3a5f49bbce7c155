// SPDX-License-Identifier: Apache-2.0
// A scene archive holds a SceneDescription as bytes, for the same build on the same machine: the
// process that reads a model passes the scene on in this form. Texels that the receiver decoded
// itself are not part of it (Texture::held).
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Writes the scene. `next` gets the number of bytes that were written into the memory that it
/// returned before, and returns the next memory, at least one byte; the last call is for the end.
void write_scene_archive(const SceneDescription& scene,
                         const std::function<std::span<uint8_t>(size_t written)>& next);

/// Reads a scene from the pieces that `next` returns, each at least one byte; the bytes may change
/// while they are read. Sizes are checked before memory is allocated for them, and indices at the
/// end. Throws Error(Input) with the cause for an archive that no writer made, and the errors of
/// `next`.
[[nodiscard]] SceneDescription read_scene_archive(
    const std::function<std::span<const uint8_t>()>& next);

}  // namespace lenticule::render
