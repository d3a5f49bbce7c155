// SPDX-License-Identifier: Apache-2.0
// load_scene reads a scene file of any supported format.
#pragma once

#include <filesystem>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Loads a file in any supported format, chosen by its extension. Throws Error(Input) with the
/// file, the line if the format has lines, and the reason. Non-finite vertices are errors.
/// Zero-area triangles are dropped and noted; zero or non-finite normals are recomputed and noted.
[[nodiscard]] SceneDescription load_scene(const std::filesystem::path& file);

}  // namespace lenticule::render
