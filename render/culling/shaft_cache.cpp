// SPDX-License-Identifier: Apache-2.0
#include "render/culling/shaft_cache.h"

#include <cmath>

#include "render/culling/octahedron.h"

namespace lenticule::render {
namespace {

constexpr unsigned kAnswersLog2 = 20;

size_t primitives_of(const Scene& scene, const GeometryEntry& entry) {
  switch (entry.kind) {
    case GeometryEntry::Kind::Spheres:
      return scene.spheres.size();
    case GeometryEntry::Kind::Cones:
      return scene.cones.size();
    case GeometryEntry::Kind::Mesh:
      break;
  }
  return scene.meshes[entry.mesh].triangles.size();
}

}  // namespace

ShaftCache::ShaftCache(const Scene& scene, const PrimitiveTree& tree)
    : scene_(scene), tester_(std::make_shared<const ShaftTester>(scene, tree)) {
  uint64_t first = 0;
  for (const GeometryEntry& entry : scene.geometries) {
    first_primitive_.push_back(first);
    first += primitives_of(scene, entry);
  }
}

ShaftCache::ShaftCache(const ShaftCache& points, SoftSizes sizes)
    : scene_(points.scene_),
      tester_(points.tester_),
      sizes_(sizes),
      sun_cosine_(static_cast<float>(1.0 / std::hypot(1.0, sizes.sun_tangent))),
      first_primitive_(points.first_primitive_) {}

ShaftCache::~ShaftCache() = default;

ShaftCache& ShaftCache::with_sizes(SoftSizes sizes) {
  if (sizes == sizes_) return *this;
  const std::lock_guard lock(adding_);
  for (const std::unique_ptr<ShaftCache>& other : others_)
    if (other->sizes_ == sizes) return *other;
  others_.push_back(std::unique_ptr<ShaftCache>(new ShaftCache(*this, sizes)));
  return *others_.back();
}

ShaftResult ShaftCache::result(const SurfaceCell& cell, uint64_t number, uint64_t target) {
  if (target >= kTargets) return ShaftResult::None;
  std::call_once(
      asked_, [this] { answers_ = std::vector<std::atomic<uint64_t>>(size_t{1} << kAnswersLog2); });
  const uint64_t key = (number * kTargets + target) << 2;
  std::atomic<uint64_t>& place = answers_[mixed(key, kAnswersLog2)];
  const uint64_t known = place.load(std::memory_order_relaxed);
  if ((known & ~uint64_t{3}) == key && known != 0) return static_cast<ShaftResult>(known & 3);
  const ShaftResult result = find_out(cell, target);
  place.store(key | static_cast<uint64_t>(result), std::memory_order_relaxed);
  return result;
}

ShaftResult ShaftCache::find_out(const SurfaceCell& cell, uint64_t target) const {
  const auto answer = [&](const Shaft& shaft) {
    if (tester_->empty(shaft)) return ShaftResult::Empty;
    return tester_->blocked(shaft) ? ShaftResult::Blocked : ShaftResult::None;
  };
  const Patch from = patch_of(scene_, cell);
  if (target < kBins) {
    const DirectionCell bin =
        direction_cell(static_cast<int>(target) / kDirectionBins,
                       static_cast<int>(target) % kDirectionBins, kDirectionBins);
    return answer(shaft_in_cone(from, bin.middle, bin.cosine));
  }
  if (target == kAround) return answer(shaft_around(from, sizes_.around));
  const SceneLight& area_light = scene_.lights[target - kBins];
  // Parallel rays: a cone as narrow as rounding allows.
  if (area_light.kind == Light::Kind::Directional)
    return answer(shaft_in_cone(from, Vec3f(-area_light.direction), sun_cosine_));
  if (sizes_.light_radius > 0.0)
    return answer(shaft_to_ball(from, area_light.position, sizes_.light_radius));
  return answer(shaft_to_point(from, area_light.position));
}

}  // namespace lenticule::render
