// SPDX-License-Identifier: Apache-2.0
#include "render/wavefront.h"

#include <algorithm>

#include "render/shading.h"
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

/// So few that rays and hits never leave the first cache.
constexpr int kFewPackets = 8;
static_assert(TilePlan::kColumns % kFewPackets == 0);

PathRay primary_ray(const RTCRay16& lanes, size_t r, double weight, uint32_t target, int channel) {
  return {.origin = {double{lanes.org_x[r]}, double{lanes.org_y[r]}, double{lanes.org_z[r]}},
          .direction = normalized(
              Vec3{double{lanes.dir_x[r]}, double{lanes.dir_y[r]}, double{lanes.dir_z[r]}}),
          .weight = weight,
          .target = target,
          .channel = channel};
}

}  // namespace

void Wavefront::trace(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile,
                      int max_depth, double weight, PrimaryPackets::Maker& maker,
                      std::span<double> light, RayCounts& counts) {
  trace_primary(scene, plan, tile, weight, maker, light, counts);
  for (int depth = 0;; ++depth) {
    visit_surfaces(scene, light);
    add_lights(scene, light, counts);
    if (depth == max_depth) return;
    continue_rays();
    if (next_.empty()) return;
    counts.secondary += next_.size();
    generation_.swap(next_);
    hits_.resize(generation_.size());
    // Neighbouring reflections spread: there the packet traversal loses.
    counts.invalid += intersect(scene.embree.get(), generation_, Coherence::Incoherent, hits_);
  }
}

void Wavefront::trace_primary(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile,
                              double weight, PrimaryPackets::Maker& maker, std::span<double> light,
                              RayCounts& counts) {
  if (packets_.empty()) {
    packets_.resize(kFewPackets);
    init_packets(packets_);
  }
  generation_.clear();
  hits_.clear();
  maker.prepare(packets_);
  for (int column = 0; column < tile.columns; column += kFewPackets) {
    maker.columns(column, packets_);
    for (int k = 0; k < kFewPackets; ++k) {
      RayPacket& packet = packets_[static_cast<size_t>(k)];
      intersect16(packet.valid, scene.embree.get(), packet.rays, Coherence::Coherent);
      sort_primary(scene, plan, tile, column + k, weight, packet, light, counts);
    }
  }
  counts.invalid += maker.refused();
}

/// Rays that met something become the first generation; the others see the backdrop.
void Wavefront::sort_primary(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile,
                             int column, double weight, const RayPacket& packet,
                             std::span<double> light, RayCounts& counts) {
  for (size_t r = 0; r < kPacket; ++r) {
    if (packet.valid[r] == 0) continue;
    ++counts.primary;
    const int row = static_cast<int>(r);
    const auto target = static_cast<uint32_t>(row * tile.columns + column);
    const int channel = plan.subpixel(tile, column, row) % 3;
    const RTCRay16& lanes = packet.rays.ray;
    if (packet.rays.hit.geomID[r] == Hit::kMiss) {
      const Backdrop& backdrop = scene.backdrop;
      light[target] +=
          weight *
          (backdrop.flat()
               ? component(backdrop.colour, channel)
               : backdrop_light(backdrop, primary_ray(lanes, r, weight, target, channel).direction,
                                channel));
      continue;
    }
    generation_.push_back(primary_ray(lanes, r, weight, target, channel));
    const Vec3 way{double{lanes.dir_x[r]}, double{lanes.dir_y[r]}, double{lanes.dir_z[r]}};
    hits_.push_back({.geometry = packet.rays.hit.geomID[r],
                     .primitive = packet.rays.hit.primID[r],
                     .distance = static_cast<float>(lanes.tfar[r] * length(way))});
  }
}

void Wavefront::visit_surfaces(const Scene::Impl& scene, std::span<double> light) {
  visits_.clear();
  for (size_t i = 0; i < generation_.size(); ++i) {
    const PathRay& ray = generation_[i];
    if (hits_[i].geometry == Hit::kRefused) continue;
    if (hits_[i].geometry == Hit::kMiss) {
      light[ray.target] += ray.weight * backdrop_light(scene.backdrop, ray.direction, ray.channel);
      continue;
    }
    visits_.push_back({&ray, surface_at(scene, ray, hits_[i])});
    light[ray.target] += ray.weight * own_light(visits_.back().surface, scene.ambient, ray.channel);
  }
}

void Wavefront::add_lights(const Scene::Impl& scene, std::span<double> light, RayCounts& counts) {
  for (const SceneLight& lamp : scene.lights) {
    shadow_rays_.clear();
    for (const Visit& visit : visits_) {
      const PathRay& ray = *visit.ray;
      const Vec3 start = spawn_point(visit.surface, Side::Viewer);
      const Arrival at = arrival(lamp, start, scene.units_per_world, ray.channel);
      const double reflected = ray.weight * reflected_light(visit.surface, ray.direction, at);
      if (reflected == 0.0) continue;
      shadow_rays_.push_back({.origin = start,
                              .direction = at.toward_light,
                              .distance = at.distance,
                              .light = reflected,
                              .target = ray.target});
    }
    counts.shadow += shadow_rays_.size();
    counts.invalid += add_unshadowed(scene.embree.get(), shadow_rays_, light);
  }
}

void Wavefront::continue_rays() {
  next_.clear();
  const auto follow = [this](const Visit& visit, Side side, Vec3 direction, double weight) {
    if (weight == 0.0) return;
    next_.push_back({.origin = spawn_point(visit.surface, side),
                     .direction = direction,
                     .weight = visit.ray->weight * weight,
                     .target = visit.ray->target,
                     .channel = visit.ray->channel});
  };
  for (const Visit& visit : visits_) {
    const Continuation on = continuation(visit.surface, visit.ray->direction);
    follow(visit, Side::Viewer, on.mirror_direction, on.mirror_weight);
    follow(visit, Side::Far, on.transmit_direction, on.transmit_weight);
  }
}

}  // namespace lenticule::render
