// SPDX-License-Identifier: Apache-2.0
// The steps of turning assimp's scene into ours. Everything assimp says is checked: its importers
// pass on what files claim.
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

/// assimp's glTF reader has conventions of its own for cameras and lights.
[[nodiscard]] bool is_gltf(const std::string& source);

/// Throws Error(Input) naming the mesh and the vertex or face that cannot be used.
void check_meshes(const aiScene& from, const std::string& source);

/// Materials with their base-colour textures; `folder` is where relative names start.
void import_materials(const aiScene& from, const std::filesystem::path& folder,
                      SceneDescription& scene);

/// Index of the first node of each name.
using NodeNames = std::unordered_map<std::string, int>;

/// Nodes, parents first, with the meshes that hang on them.
[[nodiscard]] NodeNames import_nodes_and_meshes(const aiScene& from, SceneDescription& scene);

/// The first animation's key frames.
void import_animation(const aiScene& from, const NodeNames& nodes, SceneDescription& scene);

void import_lights(const aiScene& from, const NodeNames& nodes, SceneDescription& scene);

/// Needs the meshes in their places: a file says where its camera looks, not how far.
void import_cameras(const aiScene& from, const NodeNames& nodes, SceneDescription& scene);

/// Scales all lights together so that they light the middle of the scene well. Files count in
/// candela, watts or nothing at all, and leave the exposure to the viewer.
void expose(SceneDescription& scene);

}  // namespace lenticule::render
