// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

// Offset of secondary rays from the surface, as a fraction of (their largest coordinate + the
// primitive's extent there, or the reach of a wide one): 16 roundings of single precision. This
// bounds the error of rounding the ray's start and of intersecting the same primitive again. It
// contains no absolute length.
constexpr double kSpawnOffset = 1.0 / (1 << 20);

// Smallest sine between ray and plane at which the plane determines the intersection precisely
// enough.
constexpr double kGrazing = 1e-7;

/// Returns the point where the ray meets the triangle's plane, clamped to the triangle: at an edge,
/// single and double precision may choose different neighbours.
Barycentric meet_triangle(Vec3 a, Vec3 edge1, Vec3 edge2, const PathRay& ray, float distance) {
  const Vec3 across = cross(ray.direction, edge2);
  const double determinant = dot(edge1, across);
  const Vec3 from_a = ray.origin - a;
  Barycentric at;
  if (std::abs(determinant) > kGrazing * length(edge1) * length(edge2)) {
    at.u = dot(from_a, across) / determinant;
    at.v = dot(ray.direction, cross(from_a, edge1)) / determinant;
  } else {
    const Vec3 normal = cross(edge1, edge2);
    const Vec3 p = from_a + ray.direction * double{distance};
    const double area = dot(normal, normal);
    at.u = dot(cross(p, edge2), normal) / area;
    at.v = dot(cross(edge1, p), normal) / area;
  }
  at.u = std::clamp(at.u, 0.0, 1.0);
  at.v = std::clamp(at.v, 0.0, 1.0);
  const double sum = at.u + at.v;
  return sum > 1.0 ? Barycentric{at.u / sum, at.v / sum} : at;
}

/// Turns both normals to the viewer's side, and sets outer_side.
void face_viewer(Surface& surface, Vec3 direction, Vec3 outer) {
  surface.outer_side = dot(direction, outer) <= 0.0;
  surface.geometric_normal = surface.outer_side ? outer : -outer;
  if (surface.shading_normal == Vec3{})
    surface.shading_normal = surface.geometric_normal;
  else if (dot(surface.shading_normal, surface.geometric_normal) < 0.0)
    surface.shading_normal = -surface.shading_normal;
}

double textured_colour(const Scene& scene, const Material& material, const MeshShape& mesh,
                       uint32_t triangle, Barycentric at, int channel) {
  const double plain = component(material.colour, channel);
  if (material.texture < 0) return plain;
  return plain * texture_of_mesh(*scene.textures[static_cast<size_t>(material.texture)], mesh,
                                 triangle, at, channel);
}

Surface on_mesh(const Scene& scene, const MeshShape& mesh, const PathRay& ray, const Hit& hit) {
  const std::array<uint32_t, 3>& triangle = mesh.triangles[hit.primitive];
  const std::array<Vec3, 3> corner = corners_of(scene, mesh, hit.primitive);
  const Vec3 a = corner[0];
  const Vec3 edge1 = corner[1] - a;
  const Vec3 edge2 = corner[2] - a;
  const Barycentric at = meet_triangle(a, edge1, edge2, ray, hit.distance);

  Surface surface;
  surface.mesh = &mesh;
  surface.triangle = hit.primitive;
  surface.at = at;
  surface.point = a + edge1 * at.u + edge2 * at.v;
  if (!mesh.normals.empty())
    surface.shading_normal =
        normalized(Vec3(mesh.normals[triangle[0]]) * (1.0 - at.u - at.v) +
                   Vec3(mesh.normals[triangle[1]]) * at.u + Vec3(mesh.normals[triangle[2]]) * at.v);
  face_viewer(surface, ray.direction, normalized(cross(edge1, edge2)));
  const WideTriangle* wide = scene.wide_triangle(mesh, hit.primitive);
  const double extent = wide != nullptr ? wide->reach : extent_of(corner);
  surface.spawn_offset = kSpawnOffset * (largest_size(surface.point) + extent);
  surface.material = &scene.materials[static_cast<size_t>(mesh.material)];
  surface.colour = textured_colour(scene, *surface.material, mesh, hit.primitive, at, ray.channel);
  return surface;
}

template <class Shape>
Surface on_shape(const Scene& scene, const Shape& shape, const PathRay& ray, const Hit& hit) {
  // Takes the root nearest to Embree's single-precision hit. At an outline the exact ray may miss
  // the shape; then the point nearest to Embree's hit is taken.
  const double near = hit.distance;
  const Roots roots = meet(shape, ray.origin, ray.direction);
  double t = near;
  for (int i = 0; i < roots.count; ++i)
    if (i == 0 || std::abs(roots.t[i] - near) < std::abs(t - near)) t = roots.t[i];

  Surface surface;
  surface.point = project_onto(shape, ray.origin + ray.direction * t);
  const Vec3 outer = outer_normal(shape, surface.point);
  face_viewer(surface, ray.direction, outer == Vec3{} ? -ray.direction : outer);
  surface.spawn_offset = kSpawnOffset * largest_size(surface.point);
  if constexpr (std::is_same_v<Shape, SphereShape>) surface.curvature = 1.0 / shape.radius;
  surface.material = &scene.materials[static_cast<size_t>(shape.material)];
  surface.colour = component(surface.material->colour, ray.channel);
  return surface;
}

}  // namespace

double texture_of_mesh(const Texture& texture, const MeshShape& mesh, uint32_t triangle,
                       Barycentric at, int channel) {
  if (mesh.uvs.empty()) return 1.0;
  const std::array<uint32_t, 3>& corners = mesh.triangles[triangle];
  const auto& a = mesh.uvs[corners[0]];
  const auto& b = mesh.uvs[corners[1]];
  const auto& c = mesh.uvs[corners[2]];
  const double w = 1.0 - at.u - at.v;
  return texture_value(texture, w * a[0] + at.u * b[0] + at.v * c[0],
                       w * a[1] + at.u * b[1] + at.v * c[1], channel);
}

Surface surface_at(const Scene& scene, const PathRay& ray, const Hit& hit) {
  const GeometryEntry& geometry = scene.geometries[hit.geometry];
  switch (geometry.kind) {
    case GeometryEntry::Kind::Spheres:
      return on_shape(scene, scene.spheres[hit.primitive], ray, hit);
    case GeometryEntry::Kind::Cones:
      return on_shape(scene, scene.cones[hit.primitive], ray, hit);
    case GeometryEntry::Kind::Mesh:
      break;
  }
  return on_mesh(scene, scene.meshes[geometry.mesh], ray, hit);
}

std::optional<Surface> first_surface(const Scene& scene, Vec3 origin, Vec3 direction, double far) {
  RTCRayHit ray = single_ray(Vec3f(origin), Vec3f(direction), static_cast<float>(far));
  intersect1(scene.embree, ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return surface_at(
      scene, {.origin = origin, .direction = direction},
      {.geometry = ray.hit.geomID, .primitive = ray.hit.primID, .distance = ray.ray.tfar});
}

// ---- shading

namespace {

double spot_factor(const SceneLight& light, Vec3 toward_light) {
  const double cosine = -dot(light.direction, toward_light);
  const double width = light.cos_inner - light.cos_outer;
  if (!(width > 0.0)) return cosine >= light.cos_outer ? 1.0 : 0.0;
  const double inside = std::clamp((cosine - light.cos_outer) / width, 0.0, 1.0);
  return inside * inside;
}

Vec3 mirrored(Vec3 direction, Vec3 normal) {
  return direction - normal * (2.0 * dot(direction, normal));
}

/// Mirrors at the interpolated normal, or at the geometric normal if the interpolated one would
/// mirror the ray into its own surface.
Vec3 mirror_direction(const Surface& surface, Vec3 direction) {
  const Vec3 smooth = mirrored(direction, surface.shading_normal);
  return normalized(dot(smooth, surface.geometric_normal) > 0.0
                        ? smooth
                        : mirrored(direction, surface.geometric_normal));
}

std::optional<Vec3> transmit_direction(const Surface& surface, Vec3 direction) {
  const double index = surface.material->refraction_index;
  if (index == 1.0) return direction;
  const double eta = surface.outer_side ? 1.0 / index : index;
  if (dot(direction, surface.shading_normal) < 0.0) {
    const auto smooth = refracted(direction, surface.shading_normal, eta);
    if (!smooth || dot(*smooth, surface.geometric_normal) < 0.0) return smooth;
  }
  return refracted(direction, surface.geometric_normal, eta);
}

}  // namespace

std::optional<Vec3> refracted(Vec3 direction, Vec3 normal, double eta) {
  const double cosine = std::min(1.0, -dot(direction, normal));
  const double squared = 1.0 - eta * eta * (1.0 - cosine * cosine);
  // Rounding must not turn the critical angle into total reflection.
  if (squared < -4.0 * std::numeric_limits<double>::epsilon()) return std::nullopt;
  return normalized(direction * eta + normal * (eta * cosine - std::sqrt(std::max(0.0, squared))));
}

Arrival arrival(const SceneLight& light, Vec3 point, double units_per_world, int channel) {
  const double colour = component(light.colour, channel);
  if (light.kind == Light::Kind::Directional)
    return {-light.direction, std::numeric_limits<double>::infinity(), colour};
  const Vec3 way = light.position - point;
  const double distance = length(way);
  if (!(distance > 0.0)) return {};
  Arrival at{way / distance, distance, colour};
  if (light.kind == Light::Kind::Spot) at.intensity *= spot_factor(light, at.toward_light);
  if (light.falls_off) {
    const double world_distance = distance / units_per_world;
    at.intensity /= world_distance * world_distance;
  }
  return at;
}

Continuation continuation(const Surface& surface, Vec3 direction) {
  const Material& material = *surface.material;
  Continuation on;
  on.mirror_weight = material.specular * (material.tinted_specular ? surface.colour : 1.0);
  const double through = material.transmittance * surface.colour;
  if (through > 0.0) {
    if (const auto bent = transmit_direction(surface, direction)) {
      on.transmit_weight = through;
      on.transmit_direction = *bent;
    } else {
      on.mirror_weight += through;
    }
  }
  if (on.mirror_weight > 0.0) on.mirror_direction = mirror_direction(surface, direction);
  return on;
}

}  // namespace lenticule::render
