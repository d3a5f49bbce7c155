// SPDX-License-Identifier: Apache-2.0
#include "render/wavefront.h"

#include <algorithm>

#include "render/shading.h"

namespace lenticule::render {

RayCounts& RayCounts::operator+=(const RayCounts& other) {
  primary += other.primary;
  secondary += other.secondary;
  shadow += other.shadow;
  invalid += other.invalid;
  return *this;
}

void Wavefront::trace(const Scene::Impl& scene, int max_depth, std::span<const PathRay> rays,
                      std::span<double> light, RayCounts& counts) {
  counts.primary += static_cast<uint64_t>(std::count_if(
      rays.begin(), rays.end(), [](const PathRay& r) { return r.target != PathRay::kInactive; }));
  for (int depth = 0;; ++depth) {
    hits_.resize(rays.size());
    // Neighbouring reflections spread: there the packet traversal loses.
    const Coherence coherence = depth == 0 ? Coherence::Coherent : Coherence::Incoherent;
    counts.invalid += intersect(scene.embree.get(), rays, coherence, hits_);
    visit_surfaces(scene, rays, light);
    add_lights(scene, light, counts);
    if (depth == max_depth) return;
    continue_rays();
    if (next_.empty()) return;
    counts.secondary += next_.size();
    generation_.swap(next_);
    rays = generation_;
  }
}

void Wavefront::visit_surfaces(const Scene::Impl& scene, std::span<const PathRay> rays,
                               std::span<double> light) {
  visits_.clear();
  for (size_t i = 0; i < rays.size(); ++i) {
    const PathRay& ray = rays[i];
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
