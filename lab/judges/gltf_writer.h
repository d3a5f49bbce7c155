// SPDX-License-Identifier: Apache-2.0
// write_gltf writes a scene as one glTF 2.0 file, so that a built-in scene can be measured with the
// materials and lights of glTF.
#pragma once

#include <string>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::lab {

struct GltfText {
  std::string json;
  std::vector<std::string> notes;  ///< properties that glTF expresses differently
};

/// Writes triangle meshes with normals, texture coordinates and embedded textures, point lights,
/// and the first camera. The description must have no nodes. Throws Error(Usage) for spheres,
/// cones, and lights that are not points, which glTF or this writer does not support.
[[nodiscard]] GltfText write_gltf(const render::SceneDescription& scene);

}  // namespace lenticule::lab
