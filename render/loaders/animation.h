// SPDX-License-Identifier: Apache-2.0
// Baking of static nodes; see also at_time() in scene_description.h.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Parses one pose per line, nine or ten numbers: from (3), at (3), up (3) and optionally the
/// vertical field of view in degrees, which also applies to the following lines (initially 45). '#'
/// starts a comment. Throws Error(Input) "source:line: reason"; a file without a pose is an error.
[[nodiscard]] std::vector<Camera> parse_camera_path(std::string_view text,
                                                    const std::string& source);
[[nodiscard]] std::vector<Camera> load_camera_path(const std::filesystem::path& file);

/// Transforms all content whose node never moves to world coordinates, and drops the nodes if none
/// moves, so that frames do not repeat this work.
void bake_still_nodes(SceneDescription& scene);

/// Returns the map with this translation, rotation (quaternion, need not be of unit length) and
/// scale.
[[nodiscard]] Affine compose(Vec3 translation, const std::array<double, 4>& rotation, Vec3 scale);

/// Returns the map from each node's coordinates to the world's.
[[nodiscard]] std::vector<Affine> world_from_nodes(const std::vector<Node>& nodes, double seconds);

/// Transforms a mesh; a map that mirrors also reverses the corners of the triangles. Throws
/// Error(Input) if a vertex becomes non-finite.
void transform_mesh(TriangleMesh& mesh, const Affine& map);

/// Rotates the whole scene: its objects, and the nodes that move them.
void transform_scene(SceneDescription& scene, const Affine& rotation);

}  // namespace lenticule::render
