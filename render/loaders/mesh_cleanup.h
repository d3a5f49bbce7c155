// SPDX-License-Identifier: Apache-2.0
// Repairs a mesh from a file for tracing.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

struct MeshRepairs {
  size_t dropped_triangles = 0;
  size_t recomputed_normals = 0;
};

/// Drops triangles without area. Replaces zero or non-finite normals by the mean of the adjacent
/// faces' normals; normalizes all other normals. Positions must be finite, and indices in range.
MeshRepairs clean(TriangleMesh& mesh);

}  // namespace lenticule::render
