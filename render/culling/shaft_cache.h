// SPDX-License-Identifier: Apache-2.0
// ShaftCache caches the results of shaft tests for a scene.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "render/culling/shaft.h"

namespace lenticule::render {

/// Result of the conservative tests of a shaft. The values are stored in two bits of the cache.
enum class ShaftResult : uint8_t {
  None = 1,     ///< unknown: rays must be traced
  Empty = 2,    ///< no ray meets anything
  Blocked = 3,  ///< each ray meets something before it reaches the light
};

/// Sizes of the scene's area lights, and length of the ambient rays.
struct SoftSizes {
  double light_radius = 0.0;  ///< radius of point and spot lights, in scene units; 0 for points
  double sun_tangent = 0.0;   ///< directional lights: tangent of the angular radius
  double around = 0.0;        ///< length of ambient rays, in scene units
  friend bool operator==(const SoftSizes&, const SoftSizes&) = default;
};

/// ShaftCache answers queries for shafts: it tests a shaft at the first query and keeps the result
/// while there is space in the cache. Results depend on the scene only, not on the order of
/// queries. Thread safety: usable from any thread.
class ShaftCache {
 public:
  /// Lifetime: `scene` and its tree `tree` must outlive the object.
  ShaftCache(const Scene& scene, const PrimitiveTree& tree);
  ~ShaftCache();
  ShaftCache(const ShaftCache&) = delete;
  ShaftCache& operator=(const ShaftCache&) = delete;

  /// Returns the cache for other light sizes than zero. The first call for given sizes allocates
  /// the cache. Lifetime: the returned cache lives as long as this object.
  [[nodiscard]] ShaftCache& with_sizes(SoftSizes sizes);

  /// Returns the number of a cell for queries; below 2^50. See render/scene/surface_cells.h for
  /// `place`.
  [[nodiscard]] uint64_t number(uint32_t geometry, uint32_t primitive, int32_t place) const {
    return (first_primitive_[geometry] + primitive) << kPlaceBits | static_cast<uint32_t>(place);
  }
  /// Number of direction bins of a cell; the first targets, which must be below kTargets.
  static constexpr uint64_t kBins = uint64_t{kDirectionBins} * kDirectionBins;
  static constexpr uint64_t light_target(size_t light) {
    return light < kAround - kBins ? kBins + light : kTargets;  // kTargets: always unknown
  }
  static constexpr uint64_t direction_target(int bin_u, int bin_v) {
    return static_cast<uint64_t>(bin_u * kDirectionBins + bin_v);
  }
  static constexpr uint64_t kTargets = 2048;
  /// Target of the ambient rays: all directions, up to SoftSizes::around.
  static constexpr uint64_t kAround = kTargets - 1;
  /// Returns a place in a table of 2^bits elements by Fibonacci hashing: the high bits of the
  /// product are well mixed.
  static constexpr size_t mixed(uint64_t key, unsigned bits) {
    return static_cast<size_t>(key * 0x9e3779b97f4a7c15U >> (64 - bits));
  }

  /// Returns the result for the rays from the cell to the light, in all directions around it, or in
  /// the directions of one bin (of kDirectionBins x kDirectionBins on the unfolded octahedron).
  /// `number` is the cell's number.
  [[nodiscard]] ShaftResult result(const SurfaceCell& cell, uint64_t number, uint64_t target);

 private:
  ShaftCache(const ShaftCache& points, SoftSizes sizes);
  [[nodiscard]] ShaftResult find_out(const SurfaceCell& cell, uint64_t target) const;

  const Scene& scene_;
  std::shared_ptr<const ShaftTester> tester_;
  SoftSizes sizes_;
  float sun_cosine_ = 1.0F;
  std::vector<uint64_t> first_primitive_;  ///< per geometry, counted over all geometries
  /// Each entry is a key and a result, or zero. Allocated by the first query, since many frames
  /// make none.
  std::vector<std::atomic<uint64_t>> answers_;
  std::once_flag asked_;
  std::mutex adding_;
  std::vector<std::unique_ptr<ShaftCache>> others_;  ///< caches for other light sizes
};

}  // namespace lenticule::render
