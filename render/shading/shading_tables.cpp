// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading_tables.h"

#include <algorithm>
#include <limits>

namespace lenticule::render {
namespace {

shading_kernel::Material table_entry(const Material& material) {
  shading_kernel::Material out{};
  write(material.colour, out.colour);
  write(material.emission, out.emission);
  out.diffuse = static_cast<float>(material.diffuse);
  out.specular = static_cast<float>(material.specular);
  out.shine = static_cast<float>(material.shine);
  out.transmittance = static_cast<float>(material.transmittance);
  out.tinted = material.tinted_specular ? 1 : 0;
  out.textured = material.texture >= 0 ? 1 : 0;
  return out;
}

shading_kernel::Quadric table_entry(const SphereShape& sphere) {
  shading_kernel::Quadric out{};
  write(sphere.centre, out.centre);
  out.radius = static_cast<float>(sphere.radius);
  out.outward = sphere.inward ? -1.0F : 1.0F;
  out.material = sphere.material;
  return out;
}

shading_kernel::Quadric table_entry(const ConeShape& cone) {
  shading_kernel::Quadric out{};
  write(cone.base, out.centre);
  write(cone.axis, out.axis);
  out.radius = static_cast<float>(cone.base_radius);
  out.height = static_cast<float>(cone.height);
  out.slope = static_cast<float>(cone.slope);
  out.outward = cone.inward ? -1.0F : 1.0F;
  out.material = cone.material;
  return out;
}

shading_kernel::Light table_entry(const SceneLight& light, double units_per_world) {
  static_assert(static_cast<int>(Light::Kind::Directional) == shading_kernel::Light::kDirectional &&
                static_cast<int>(Light::Kind::Spot) == shading_kernel::Light::kSpot);
  shading_kernel::Light out{};
  out.kind = static_cast<shading_kernel::Light::Kind>(light.kind);
  write(light.position, out.position);
  write(light.direction, out.direction);
  write(light.colour, out.colour);
  out.cos_outer = static_cast<float>(light.cos_outer);
  out.cos_width = static_cast<float>(light.cos_inner - light.cos_outer);
  out.falls_off = light.falls_off ? 1 : 0;
  out.world_units_squared = static_cast<float>(units_per_world * units_per_world);
  return out;
}

shading_kernel::WideTriangle wide_entry(const WideTriangle& triangle) {
  shading_kernel::WideTriangle out{};
  write(triangle.corner[0], out.corner);
  write(triangle.corner[1] - triangle.corner[0], out.edge1);
  write(triangle.corner[2] - triangle.corner[0], out.edge2);
  write(triangle.normal, out.normal);
  write(triangle.u_axis, out.u_axis);
  write(triangle.v_axis, out.v_axis);
  out.reach = triangle.reach;
  return out;
}

shading_kernel::WideQuadric wide_entry(const SphereShape& sphere) {
  shading_kernel::WideQuadric out{};
  write(sphere.centre, out.centre);
  out.radius = sphere.radius;
  out.reach = wide_reach(sphere.radius);
  return out;
}

shading_kernel::WideQuadric wide_entry(const ConeShape& cone) {
  shading_kernel::WideQuadric out{};
  write(cone.base, out.centre);
  write(cone.axis, out.axis);
  out.radius = cone.base_radius;
  out.height = cone.height;
  out.slope = cone.slope;
  out.reach = wide_reach(extent_of(cone));
  return out;
}

/// Adds the shading data of shapes; for wide shapes also the data in double precision.
template <class Shape>
void add_shapes(const std::vector<Shape>& shapes, std::vector<shading_kernel::Quadric>& out,
                std::deque<shading_kernel::WideQuadric>& wide) {
  for (const Shape& shape : shapes) {
    shading_kernel::Quadric& entry = out.emplace_back(table_entry(shape));
    if (extent_of(shape) > kWidest) entry.wide = &wide.emplace_back(wide_entry(shape));
  }
}

shading_kernel::Geometry table_entry(const MeshShape& mesh,
                                     const std::vector<shading_kernel::WideTriangle>& wide) {
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  static_assert(MeshShape::kNotWide == shading_kernel::kNotWide);
  shading_kernel::Geometry out{};
  out.kind = shading_kernel::Geometry::kMesh;
  out.mesh = {.positions = &mesh.positions.data()->x,
              .triangles = mesh.triangles.data()->data(),
              .normals = mesh.normals.empty() ? nullptr : &mesh.normals.data()->x,
              .material = mesh.material,
              .wide = mesh.wide.empty() ? nullptr : mesh.wide.data(),
              .wide_triangles = wide.data()};
  return out;
}

constexpr float kInfinity = std::numeric_limits<float>::infinity();

float largest_part(Vec3 v) { return static_cast<float>(largest(v)); }

/// Returns an upper bound of the light from all light sources together; infinite if one of them
/// falls off, since its intensity is unbounded.
float most_arriving(const std::vector<SceneLight>& lights) {
  float sum = 0.0F;
  for (const SceneLight& light : lights)
    sum += light.falls_off ? kInfinity : largest_part(light.colour);
  return sum;
}

/// Returns true if no light can be negative. Environment pictures and textures may contain negative
/// numbers, and arbitrarily large ones.
bool no_light_is_negative(const Scene& scene) {
  const auto positive = [](const auto& object) { return smallest(object.colour) >= 0.0; };
  const auto only_adds = [&](const Material& m) {
    return m.texture < 0 && positive(m) && smallest(m.emission) >= 0.0 && m.diffuse >= 0.0 &&
           m.specular >= 0.0 && m.transmittance >= 0.0;
  };
  return std::ranges::all_of(scene.lights, positive) &&
         std::ranges::all_of(scene.materials, only_adds) && smallest(scene.ambient) >= 0.0 &&
         positive(scene.backdrop) && !scene.backdrop.environment;
}

float most_from(const Material& m, float arriving, float ambient) {
  const auto diffuse = static_cast<float>(m.diffuse) * largest_part(m.colour);
  const float tint = m.tinted_specular ? largest_part(m.colour) : 1.0F;
  return largest_part(m.emission) + ambient * diffuse +
         arriving * (diffuse + static_cast<float>(m.specular) * tint);
}

float kept_by(const Material& m) {
  const float tint = m.tinted_specular ? largest_part(m.colour) : 1.0F;
  return static_cast<float>(m.specular) * tint +
         static_cast<float>(m.transmittance) * largest_part(m.colour);
}

}  // namespace

float ShadingTables::most_light(int generations) const {
  constexpr float kRounding = 1.001F;
  float most = most_direct_;
  for (int i = 0; i < generations; ++i) most = most_direct_ + most_kept_ * most;
  return most * kRounding;
}

ShadingTables::ShadingTables(const Scene& scene) {
  light_only_adds_ = no_light_is_negative(scene);
  const float arriving = most_arriving(scene.lights);
  most_direct_ = scene.backdrop.flat() ? largest_part(scene.backdrop.colour) : kInfinity;
  for (const Material& m : scene.materials) {
    most_direct_ = std::max(most_direct_, most_from(m, arriving, largest_part(scene.ambient)));
    most_kept_ = std::max(most_kept_, kept_by(m));
  }
  for (const Material& material : scene.materials) materials_.push_back(table_entry(material));
  add_shapes(scene.spheres, spheres_, wide_quadrics_);
  add_shapes(scene.cones, cones_, wide_quadrics_);
  for (const WideTriangle& triangle : scene.wide_triangles)
    wide_triangles_.push_back(wide_entry(triangle));
  for (const SceneLight& light : scene.lights)
    lights_.push_back(table_entry(light, scene.frame.units_per_world));
  for (const GeometryEntry& entry : scene.geometries) {
    using shading_kernel::Geometry;
    if (entry.kind == GeometryEntry::Kind::Mesh)
      geometries_.push_back(table_entry(scene.meshes[entry.mesh], wide_triangles_));
    else if (entry.kind == GeometryEntry::Kind::Spheres)
      geometries_.push_back({.kind = Geometry::kSpheres, .mesh = {}, .quadrics = spheres_.data()});
    else
      geometries_.push_back({.kind = Geometry::kCones, .mesh = {}, .quadrics = cones_.data()});
  }
  tables_ = {.geometries = geometries_.data(), .materials = materials_.data(), .ambient = {}};
  write(scene.ambient, tables_.ambient);
}

SurfaceCell cell_of(const RTCRayHit16& packet, const shading_kernel::Surfaces& surfaces,
                    size_t lane) {
  return {.geometry = packet.hit.geomID[lane],
          .primitive = packet.hit.primID[lane],
          .outer_side = surfaces.outer_side[lane] != 0,
          .u = surfaces.cell_u[lane],
          .v = surfaces.cell_v[lane],
          .w = surfaces.cell_w[lane],
          .divisions = surfaces.divisions[lane],
          .divisions_along = surfaces.divisions_along[lane]};
}

const shading_kernel::Kernel& shading_kernel_for(Isa isa) {
  return LENTICULE_SELECT_KERNEL(isa, kShadingKernel);
}

}  // namespace lenticule::render
