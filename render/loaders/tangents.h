// SPDX-License-Identifier: Apache-2.0
// Computes the tangents of meshes whose files have none.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Sets the tangents from texture coordinates, `uvs` or `uvs2` of the mesh; does nothing if the
/// mesh lacks them. The bitangent cross(normal, tangent) * sign points to decreasing v, as normal
/// textures of glTF require. Vertices at which the texture is mirrored are split; a mesh without
/// normals gets the faces' normals, and so three vertices per triangle.
void compute_tangents(TriangleMesh& mesh, bool use_second_uvs);

/// Makes vertex i a copy of the old vertex from[i], with all its attributes. Does not change the
/// triangles.
void select_vertices(TriangleMesh& mesh, const std::vector<uint32_t>& from);

}  // namespace lenticule::render
