// SPDX-License-Identifier: Apache-2.0
// Makes a mesh from a file fit for tracing.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

struct MeshRepairs {
  size_t dropped_triangles = 0;
  size_t recomputed_normals = 0;
};

/// Drops triangles without an area and gives zero or non-finite normals the mean of the faces
/// around their vertex; the other normals become unit vectors. Positions must be finite, indices in
/// range.
MeshRepairs clean(TriangleMesh& mesh);

}  // namespace lenticule::render
