// SPDX-License-Identifier: Apache-2.0
// Writes a scene as one glTF 2.0 file, for other programs.
#pragma once

#include <string>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::player {

struct GltfText {
  std::string json;
  std::vector<std::string> notes;  ///< what glTF says in another way than the scene
};

/// Triangle meshes with their normals, texture coordinates and textures (embedded), point lights,
/// the first camera. Of a description without nodes. Throws Error(Usage) for a scene with spheres,
/// cones, or other lights than points, which glTF cannot say or this writer does not.
[[nodiscard]] GltfText write_gltf(const render::SceneDescription& scene);

}  // namespace lenticule::player
