// SPDX-License-Identifier: Apache-2.0
#include "render/packet_tracer.h"

#include <algorithm>
#include <array>
#include <limits>

#include "render/shading.h"
#include "render/shading_tables.h"
#include "render/texture.h"

namespace lenticule::render {

RayCounts& RayCounts::operator+=(const RayCounts& other) {
  primary += other.primary;
  secondary += other.secondary;
  shadow += other.shadow;
  invalid += other.invalid;
  return *this;
}

namespace {

using shading_kernel::NewRays;
using shading_kernel::Surfaces;

static_assert(shading_kernel::kLanes == kPacket);

/// So few that rays and hits never leave the first cache.
constexpr int kFewPackets = 8;
static_assert(TilePlan::kColumns % kFewPackets == 0);

const shading_kernel::Kernel& kernel_for(Isa isa) {
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return isa_avx512::kShadingKernel;
  if (isa == Isa::Avx2) return isa_avx2::kShadingKernel;
#endif
  static_cast<void>(isa);
  return isa_baseline::kShadingKernel;
}

uint64_t count(const int* valid) {
  int sum = 0;
  for (size_t r = 0; r < kPacket; ++r) sum += valid[r];
  return static_cast<uint64_t>(-sum);
}

/// One lane as render/surface.h sees it: near the critical angle, refraction makes much of what
/// single precision rounds away.
Surface exact_surface(const Scene::Impl& scene, const RayPacket& packet, int channel, size_t r,
                      Vec3& direction) {
  const RTCRay16& ray = packet.rays.ray;
  const Vec3 way{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
  direction = normalized(way);
  return surface_at(scene,
                    {.origin = {double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}},
                     .direction = direction,
                     .channel = channel},
                    {.geometry = packet.rays.hit.geomID[r],
                     .primitive = packet.rays.hit.primID[r],
                     .distance = static_cast<float>(double{ray.tfar[r]} * length(way))});
}

void apply_textures(const Scene::Impl& scene, const RayPacket& packet, Surfaces& s) {
  for (size_t r = 0; r < kPacket; ++r) {
    if (s.active[r] == 0) continue;
    const GeometryEntry& entry = scene.geometries[packet.rays.hit.geomID[r]];
    const int texture = scene.materials[static_cast<size_t>(s.material[r])].texture;
    if (texture < 0 || entry.kind != GeometryEntry::Kind::Mesh) continue;
    s.colour[r] *= static_cast<float>(
        texture_of_mesh(*scene.textures[static_cast<size_t>(texture)], scene.meshes[entry.mesh],
                        packet.rays.hit.primID[r], {double{s.u[r]}, double{s.v[r]}}, s.channel[r]));
  }
}

void set_lane(RayPacket& packet, size_t r, Vec3 origin, Vec3 direction) {
  const Vec3f o(origin);
  const Vec3f d(direction);
  RTCRay16& ray = packet.rays.ray;
  ray.org_x[r] = o.x;
  ray.org_y[r] = o.y;
  ray.org_z[r] = o.z;
  ray.dir_x[r] = d.x;
  ray.dir_y[r] = d.y;
  ray.dir_z[r] = d.z;
  ray.tfar[r] = std::numeric_limits<float>::infinity();
}

}  // namespace

struct PacketTracer::Generation {
  Surfaces surfaces;
  RayPacket mirrored;
  RayPacket refracted;
  NewRays mirrored_rays;
  NewRays refracted_rays;
};

PacketTracer::PacketTracer(const RenderOptions& options)
    : kernel_(kernel_for(options.isa)),
      primary_(kFewPackets),
      generations_(static_cast<size_t>(options.max_depth) + 1),
      clock_(options.measure_work) {
  init_packets(primary_);
  for (Generation& generation : generations_) {
    init_packets({&generation.mirrored, 1});
    init_packets({&generation.refracted, 1});
  }
  const RTCRay16& harmless = primary_.front().rays.ray;
  lanes_.shadow = harmless;
}

PacketTracer::~PacketTracer() = default;
PacketTracer::PacketTracer(PacketTracer&&) noexcept = default;

void PacketTracer::trace(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile,
                         double weight, PrimaryPackets::Maker& maker, std::span<double> light) {
  alignas(64) std::array<float, kPacket> weights;
  weights.fill(static_cast<float>(weight));
  maker.prepare(primary_);
  for (int column = 0; column < tile.columns; column += kFewPackets) {
    clock_.turn_to(Work::MakeRays);
    maker.columns(column, primary_);
    for (int k = 0; k < kFewPackets; ++k) {
      RayPacket& packet = primary_[static_cast<size_t>(k)];
      clock_.turn_to(Work::TracePrimary);
      intersect16(packet.valid, scene.embree.get(), packet.rays, Coherence::Coherent);
      clock_.turn_to(Work::Shade);
      counts_.primary += count(packet.valid);
      for (int row = 0; row < TilePlan::kRows; ++row)
        lanes_.channel[row] = (plan.subpixel(tile, column + k, row) + 3 * TilePlan::kColumns) % 3;
      std::fill_n(lanes_.light, kPacket, 0.0F);
      shade(scene, packet, weights.data(), 0);
      double* out = light.data() + column + k;
      for (size_t row = 0; row < kPacket; ++row)
        out[row * static_cast<size_t>(tile.columns)] += double{lanes_.light[row]};
    }
  }
  counts_.invalid += maker.refused();
}

void PacketTracer::shade(const Scene::Impl& scene, const RayPacket& packet, const float* weight,
                         size_t depth) {
  Generation& generation = generations_[depth];
  Surfaces& surfaces = generation.surfaces;
  std::copy_n(lanes_.channel, kPacket, surfaces.channel);
  const bool met = kernel_.find_surfaces(scene.shading->tables(), &packet.rays.ray.org_x[0],
                                         packet.valid, surfaces);
  add_backdrop(scene, packet, weight, surfaces);
  if (!met) return;
  if (surfaces.any_textured) apply_textures(scene, packet, surfaces);
  kernel_.add_own_light(scene.shading->tables(), surfaces, weight, lanes_.light);
  add_lights(scene, surfaces, weight);
  if (depth + 1 == generations_.size()) return;
  if (surfaces.any_transmits) return follow_glass(scene, packet, generation, weight, depth);
  if (!surfaces.any_specular) return;
  NewRays& rays = generation.mirrored_rays;
  rays.packet = &generation.mirrored.rays.ray.org_x[0];
  rays.valid = generation.mirrored.valid;
  if (kernel_.mirrored_rays(surfaces, weight, rays))
    follow(scene, rays, generation.mirrored, depth);
  counts_.invalid += static_cast<uint64_t>(rays.refused);
}

void PacketTracer::add_backdrop(const Scene::Impl& scene, const RayPacket& packet,
                                const float* weight, const Surfaces& surfaces) {
  const Backdrop& backdrop = scene.backdrop;
  const bool flat = backdrop.flat();
  const float colour[3] = {static_cast<float>(backdrop.colour.x),
                           static_cast<float>(backdrop.colour.y),
                           static_cast<float>(backdrop.colour.z)};
  for (size_t r = 0; r < kPacket; ++r) {
    if (packet.valid[r] == 0 || surfaces.active[r] != 0) continue;
    if (flat) {
      lanes_.light[r] += weight[r] * colour[lanes_.channel[r]];
      continue;
    }
    const RTCRay16& ray = packet.rays.ray;
    const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    lanes_.light[r] += weight[r] * static_cast<float>(backdrop_light(
                                       backdrop, normalized(direction), lanes_.channel[r]));
  }
}

void PacketTracer::add_lights(const Scene::Impl& scene, const Surfaces& surfaces,
                              const float* weight) {
  NewRays rays;
  rays.packet = &lanes_.shadow.org_x[0];
  rays.valid = lanes_.shadow_valid;
  for (const shading_kernel::Light& light : scene.shading->lights()) {
    const bool any = kernel_.shadow_rays(light, surfaces, weight, rays);
    counts_.invalid += static_cast<uint64_t>(rays.refused);
    if (!any) continue;
    counts_.shadow += count(rays.valid);
    clock_.turn_to(Work::TraceShadows);
    occluded16(rays.valid, scene.embree.get(), lanes_.shadow, Coherence::Coherent);
    clock_.turn_to(Work::Shade);
    for (size_t r = 0; r < kPacket; ++r)
      if (rays.valid[r] != 0 && lanes_.shadow.tfar[r] >= 0.0F) lanes_.light[r] += rays.weight[r];
  }
}

/// Packets with glass in them: mirrored and refracted rays lane by lane, since total reflection
/// moves light from the one to the other.
void PacketTracer::follow_glass(const Scene::Impl& scene, const RayPacket& packet,
                                Generation& generation, const float* weight, size_t depth) {
  const Surfaces& s = generation.surfaces;
  NewRays& mirrored = generation.mirrored_rays;
  NewRays& refracted = generation.refracted_rays;
  const auto set = [&](RayPacket& rays, NewRays& brings, size_t r, Vec3 origin, Vec3 direction,
                       double part) {
    rays.valid[r] = 0;
    brings.weight[r] = weight[r] * static_cast<float>(part);
    set_lane(rays, r, {}, {0, 0, 1});
    if (brings.weight[r] == 0.0F) return;
    if (!fit_for_embree(origin, direction)) {
      ++counts_.invalid;
      return;
    }
    rays.valid[r] = -1;
    set_lane(rays, r, origin, direction);
  };
  for (size_t r = 0; r < kPacket; ++r) {
    Continuation on;
    Surface surface;
    if (s.active[r] != 0) {
      Vec3 direction;
      surface = exact_surface(scene, packet, s.channel[r], r, direction);
      on = continuation(surface, direction);
    }
    set(generation.mirrored, mirrored, r, spawn_point(surface, Side::Viewer), on.mirror_direction,
        on.mirror_weight);
    set(generation.refracted, refracted, r, spawn_point(surface, Side::Far), on.transmit_direction,
        on.transmit_weight);
  }
  follow(scene, mirrored, generation.mirrored, depth);
  follow(scene, refracted, generation.refracted, depth);
}

void PacketTracer::follow(const Scene::Impl& scene, NewRays& rays, RayPacket& packet,
                          size_t depth) {
  const uint64_t traced = count(packet.valid);
  if (traced == 0) return;
  counts_.secondary += traced;
  std::fill_n(packet.rays.hit.geomID, kPacket, RTC_INVALID_GEOMETRY_ID);
  // Mirrored by curved surfaces twice, neighbours spread: there the packet traversal loses.
  clock_.turn_to(Work::TraceSecondary);
  intersect16(packet.valid, scene.embree.get(), packet.rays,
              depth == 0 ? Coherence::Coherent : Coherence::Incoherent);
  clock_.turn_to(Work::Shade);
  shade(scene, packet, rays.weight, depth + 1);
}

}  // namespace lenticule::render
