// SPDX-License-Identifier: Apache-2.0
#include "render/shaft_proofs.h"

#include "render/octahedron.h"

namespace lenticule::render {
namespace {

constexpr unsigned kAnswersLog2 = 20;

size_t primitives_of(const Scene::Impl& scene, const GeometryEntry& entry) {
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

ShaftProofs::ShaftProofs(const Scene::Impl& scene, const PrimitiveTree& tree)
    : scene_(scene), tester_(scene, tree), answers_(size_t{1} << kAnswersLog2) {
  uint64_t first = 0;
  for (const GeometryEntry& entry : scene.geometries) {
    first_primitive_.push_back(first);
    first += primitives_of(scene, entry);
  }
}

ShaftProof ShaftProofs::proof(const SurfaceCell& cell, uint64_t number, uint64_t target) {
  if (target >= kTargets) return ShaftProof::None;
  const uint64_t key = (number * kTargets + target) << 2;
  std::atomic<uint64_t>& place = answers_[mixed(key, kAnswersLog2)];
  const uint64_t known = place.load(std::memory_order_relaxed);
  if ((known & ~uint64_t{3}) == key && known != 0) return static_cast<ShaftProof>(known & 3);
  const ShaftProof proof = find_out(cell, target);
  place.store(key | static_cast<uint64_t>(proof), std::memory_order_relaxed);
  return proof;
}

ShaftProof ShaftProofs::find_out(const SurfaceCell& cell, uint64_t target) const {
  const auto answer = [&](const Shaft& shaft) {
    if (tester_.empty(shaft)) return ShaftProof::Empty;
    return tester_.blocked(shaft) ? ShaftProof::Blocked : ShaftProof::None;
  };
  const Patch from = patch_of(scene_, cell);
  if (target < kBins) {
    const DirectionCell bin =
        direction_cell(static_cast<int>(target) / kDirectionBins,
                       static_cast<int>(target) % kDirectionBins, kDirectionBins);
    return answer(shaft_in_cone(from, bin.middle, bin.cosine));
  }
  const SceneLight& lamp = scene_.lights[target - kBins];
  // Parallel rays: a cone as narrow as rounding allows.
  if (lamp.kind == Light::Kind::Directional)
    return answer(shaft_in_cone(from, Vec3f(-lamp.direction), 1.0F));
  return answer(shaft_to_point(from, lamp.position));
}

}  // namespace lenticule::render
