// SPDX-License-Identifier: Apache-2.0
// Baking of static nodes; see also at_time() in scene_description.h.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

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
