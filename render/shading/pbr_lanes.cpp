// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_lanes.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "render/accel/ray_stream.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

Vec3 lane_of(const float (&v)[3][kPacket], size_t lane) {
  return {double{v[0][lane]}, double{v[1][lane]}, double{v[2][lane]}};
}
Vec2 lane_of(const float (&v)[2][kPacket], size_t lane) {
  return {double{v[0][lane]}, double{v[1][lane]}};
}
void set(Vec3 from, size_t lane, float (&v)[3][kPacket]) {
  v[0][lane] = static_cast<float>(from.x);
  v[1][lane] = static_cast<float>(from.y);
  v[2][lane] = static_cast<float>(from.z);
}

/// Looks up the light of the environment's source in some lanes.
void set_source(const Scene& scene, uint32_t lanes, const float (&mirror)[3][kPacket],
                float (&source)[3][kPacket]) {
  for (uint32_t left = lanes; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    set(scene.pbr->environment().source(normalized(lane_of(mirror, r))), r, source);
  }
}

}  // namespace

PbrLanes::Found PbrLanes::find(const Scene& scene, const BeamSize& beam, const RayPacket& packet,
                               uint32_t lanes) {
  if (!scene.pbr->any_plain()) return {};
  alignas(64) int valid[kPacket];
  for (size_t r = 0; r < kPacket; ++r) valid[r] = (lanes & kLaneBit[r]) != 0 ? -1 : 0;
  Found found{.all = kernel_.find(scene.pbr->tables(), scene.pbr->beam(beam),
                                  &packet.rays.ray.org_x[0], valid, surfaces_, points_)};
  if (found.all == 0) return found;
  for (uint32_t left = points_.textured; left != 0; left &= left - 1)
    apply_textures(scene, packet, static_cast<size_t>(std::countr_zero(left)));
  for (size_t r = 0; r < kPacket; ++r) {
    found.shown |= points_.alpha[r] > 0.0F ? kLaneBit[r] : 0;
    found.passing |= points_.alpha[r] < 1.0F ? kLaneBit[r] : 0;
  }
  found.shown &= found.all;
  found.passing &= found.all;
  for (size_t r = 0; r < kPacket; ++r)
    points_.active[r] = (found.shown & kLaneBit[r]) != 0 ? -1 : 0;
  return found;
}

Vec3 PbrLanes::behind(size_t lane) const {
  return lane_of(surfaces_.point, lane) -
         lane_of(surfaces_.geometric, lane) * double{surfaces_.spawn_offset[lane]};
}

void PbrLanes::apply_textures(const Scene& scene, const RayPacket& packet, size_t lane) {
  const auto number = static_cast<size_t>(surfaces_.material[lane]);
  const PbrMaterial& material = *scene.materials[number].pbr;
  const MaterialInputs& inputs = scene.pbr->inputs(number);
  const GeometryEntry& geometry = scene.geometries[packet.rays.hit.geomID[lane]];
  const double side = surfaces_.outer_side[lane] != 0 ? 1.0 : -1.0;
  SurfacePlace place{.at = {double{surfaces_.u[lane]}, double{surfaces_.v[lane]}},
                     .across = lane_of(points_.across, lane),
                     .along = lane_of(points_.along, lane),
                     .normal = lane_of(surfaces_.smooth, lane) * side};
  if (geometry.kind == GeometryEntry::Kind::Mesh) {
    place.mesh = &scene.meshes[geometry.mesh];
    place.triangle = packet.rays.hit.primID[lane];
    place.corners = place.mesh->triangles[place.triangle];
  }
  InputReader reader(scene, place);
  const MipMaps::Value base = reader.base(material, inputs.base_colour);
  points_.alpha[lane] = static_cast<float>(base[3]);
  if (base[3] == 0.0) return;
  PbrPoint point;
  const Vec3 mean_normal = reader.read_mirror(material, inputs, point);
  set({base[0], base[1], base[2]}, lane, points_.colour);
  set(point.emission, lane, points_.emission);
  points_.metallic[lane] = static_cast<float>(point.metallic);
  points_.roughness[lane] = static_cast<float>(point.roughness);
  points_.occlusion[lane] = static_cast<float>(point.occlusion);
  set(dielectric_f0(point.ior, point.specular, point.specular_colour), lane, points_.f0);
  points_.f90[lane] = static_cast<float>(point.specular);
  if (inputs.normal.maps != nullptr) {
    set(normalized(mean_normal) * side, lane, points_.normal);
    points_.spread[lane] = static_cast<float>(spread_of_normals(length(mean_normal)));
  }
  if (material.clearcoat > 0.0) apply_coat_textures(material, inputs, side, reader, lane);
}

void PbrLanes::apply_coat_textures(const PbrMaterial& material, const MaterialInputs& inputs,
                                   double side, InputReader& reader, size_t lane) {
  points_.coat[lane] = static_cast<float>(reader.scaled(material.clearcoat, inputs.clearcoat, 0));
  points_.coat_roughness[lane] = static_cast<float>(std::clamp(
      reader.scaled(material.clearcoat_roughness, inputs.clearcoat_roughness, 1), 0.0, 1.0));
  if (inputs.clearcoat_normal.maps == nullptr) return;
  const Vec3 normal = reader.mapped_normal(inputs.clearcoat_normal, 1.0);
  set(normalized(normal) * side, lane, points_.coat_normal);
  points_.coat_spread[lane] = static_cast<float>(spread_of_normals(length(normal)));
}

void PbrLanes::shade(const Scene& scene, ColourLanes& light) {
  const pbr_kernel::Tables& tables = scene.pbr->tables();
  kernel_.aim(tables, surfaces_, points_, shaded_);
  set_source(scene, shaded_.sharp, shaded_.mirror, shaded_.source);
  set_source(scene, shaded_.coat_sharp, shaded_.coat_mirror, shaded_.coat_source);
  kernel_.shade(tables, points_, shaded_);
  static_assert(sizeof light.rgb == sizeof shaded_.light);
  std::memcpy(light.rgb, shaded_.light, sizeof light.rgb);
}

void PbrLanes::light_rays(const Scene& scene, size_t light, RTCRay16& rays, int* valid,
                          ColourLanes& brings, FrameCounts& counts) const {
  pbr_kernel::LightRays out;
  out.packet = &rays.org_x[0];
  out.valid = valid;
  kernel_.light_rays(scene.shading->lights()[light], surfaces_, points_, shaded_, out);
  counts.invalid_rays += static_cast<uint64_t>(out.refused);
  std::memcpy(brings.rgb, out.brings, sizeof brings.rgb);
}

void PbrLanes::tone_map(ToneMap map, const ColourLanes& light, ColourLanes& shown) const {
  using enum pbr_kernel::ToneMap;
  kernel_.tone_map(map == ToneMap::PbrNeutral ? kPbrNeutral
                   : map == ToneMap::Aces     ? kAces
                                              : kNone,
                   light.rgb, shown.rgb);
}

}  // namespace lenticule::render
