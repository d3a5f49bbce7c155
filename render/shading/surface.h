// SPDX-License-Identifier: Apache-2.0
// The point where a ray met the scene, as shading sees it.
#pragma once

#include "render/accel/ray_stream.h"
#include "render/scene/scene.h"

namespace lenticule::render {

struct Surface {
  Vec3 point;
  Vec3 geometric_normal;      ///< unit, on the side the ray came from
  Vec3 shading_normal;        ///< unit, interpolated where the mesh has normals, on the same side
  bool outer_side = true;     ///< the ray came from outside: it would enter the object
  double spawn_offset = 0.0;  ///< how far off the surface new rays start, along the normal
  const Material* material = nullptr;
  double colour = 1.0;  ///< the material's and its texture's, in the ray's channel
};

struct Barycentric {
  double u = 0.0;
  double v = 0.0;
};

/// What the mesh's texture coordinates find in a texture, at a place of one of its triangles; 1
/// where it has none.
[[nodiscard]] double texture_of_mesh(const Texture& texture, const MeshShape& mesh,
                                     uint32_t triangle, Barycentric at, int channel);

/// Embree says which primitive was met; where, is computed here in double precision from the ray
/// and the primitive itself, so that the point lies on the surface as exactly as numbers allow.
[[nodiscard]] Surface surface_at(const Scene& scene, const PathRay& ray, const Hit& hit);

}  // namespace lenticule::render
