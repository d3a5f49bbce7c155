// SPDX-License-Identifier: Apache-2.0
// Steps of the conversion of assimp's scene to a SceneDescription. All values are checked, since
// assimp's importers pass on unchecked file content.
#pragma once

#include <assimp/scene.h>

#include <filesystem>
#include <string>
#include <unordered_map>

#include "render/scene/scene_description.h"

namespace lenticule::render {

template <class V>
[[nodiscard]] Vec3 vec3(const V& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}
[[nodiscard]] inline Vec3 colour_of(const aiColor3D& c) {
  return Vec3(Vec3f(c.r, c.g, c.b));
}

/// Throws Error(Input) with the mesh and the vertex or face that is invalid.
void check_meshes(const aiScene& from, const std::string& source);

/// Imports materials with their base-colour textures. Relative file names start at `folder`.
void import_materials(const aiScene& from, const std::filesystem::path& folder,
                      SceneDescription& scene);

/// Index of the first node of each name.
using NodeNames = std::unordered_map<std::string, int>;

/// Imports nodes, parents first, with the meshes attached to them.
[[nodiscard]] NodeNames import_nodes_and_meshes(const aiScene& from, SceneDescription& scene);

/// Imports the key frames of the first animation.
void import_animation(const aiScene& from, const NodeNames& nodes, SceneDescription& scene);

void import_lights(const aiScene& from, const NodeNames& nodes, SceneDescription& scene);

/// Imports cameras. Requires the meshes to be in place: a file states the direction in which a
/// camera looks, but not the distance.
void import_cameras(const aiScene& from, const NodeNames& nodes, SceneDescription& scene);

}  // namespace lenticule::render
