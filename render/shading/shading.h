// SPDX-License-Identifier: Apache-2.0
// The point where a ray met the scene, and Whitted shading there of one colour channel.
// docs/render/shading.md states the formulas.
#pragma once

#include <optional>

#include "render/accel/ray_stream.h"
#include "render/scene/scene.h"

namespace lenticule::render {

struct Barycentric {
  double u = 0.0;
  double v = 0.0;
};

struct Surface {
  Vec3 point;
  Vec3 geometric_normal;      ///< unit, on the side the ray came from
  Vec3 shading_normal;        ///< unit, interpolated if the mesh has normals, on the same side
  bool outer_side = true;     ///< the ray came from outside: it would enter the object
  double spawn_offset = 0.0;  ///< distance along the normal at which secondary rays start
  const Material* material = nullptr;
  double colour = 1.0;  ///< product of material and texture colour, in the ray's channel
  const MeshShape* mesh = nullptr;  ///< null on spheres and cones
  uint32_t triangle = 0;            ///< meshes only
  Barycentric at{};                 ///< meshes only
  double curvature = 0.0;           ///< 1 / radius; spheres only
};

/// Looks up a texture at a point of a mesh's triangle; returns 1 if the mesh has no texture
/// coordinates.
[[nodiscard]] double texture_of_mesh(const Texture& texture, const MeshShape& mesh,
                                     uint32_t triangle, Barycentric at, int channel);

/// Computes the surface at a hit. Only the primitive is taken from Embree; the point is computed in
/// double precision from the ray and the primitive, so that it lies on the surface as exactly as
/// possible.
[[nodiscard]] Surface surface_at(const Scene& scene, const PathRay& ray, const Hit& hit);
/// Traces a single ray; returns the first surface that it meets within the distance `far`. The
/// direction must be unit.
[[nodiscard]] std::optional<Surface> first_surface(const Scene& scene, Vec3 origin, Vec3 direction,
                                                   double far);

/// Arrival is the light that a light source sends to a point if unoccluded.
struct Arrival {
  Vec3 toward_light;       ///< unit
  double distance = 0.0;   ///< scene units; infinite for directional lights
  double intensity = 0.0;  ///< one channel; 0 outside a spot's cone
};
[[nodiscard]] Arrival arrival(const SceneLight& light, Vec3 point, double units_per_world,
                              int channel);

/// Continuation holds the secondary rays of a viewing ray. A weight of zero means that there is no
/// ray.
struct Continuation {
  double mirror_weight = 0.0;
  Vec3 mirror_direction;
  double transmit_weight = 0.0;
  Vec3 transmit_direction;
};
[[nodiscard]] Continuation continuation(const Surface& surface, Vec3 direction);

/// Refracts by Snell's law at `normal`, which faces the ray's start; `eta` is the refraction index
/// on that side over the one on the other. Returns nothing for total internal reflection.
[[nodiscard]] std::optional<Vec3> refracted(Vec3 direction, Vec3 normal, double eta);

enum class Side { Viewer, Far };
/// Returns the start of rays that leave the surface.
[[nodiscard]] inline Vec3 spawn_point(const Surface& surface, Side side) {
  const double offset = side == Side::Viewer ? surface.spawn_offset : -surface.spawn_offset;
  return surface.point + surface.geometric_normal * offset;
}

}  // namespace lenticule::render
