// SPDX-License-Identifier: Apache-2.0
// Conservative tests that a whole bundle of rays meets nothing, or that each ray of the bundle
// meets something, so that none of the rays needs to be traced. The bundles are shafts (Haines and
// Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991).
//
// A shaft consists of all rays that leave a small patch of a surface toward one point, into one
// ball, within a narrow cone of directions, or in any direction up to a given length. A shaft is
// empty if every primitive of the scene can be separated from the shaft's convex hull by a plane. A
// primitive that none of the few tried planes separates counts as possibly in the way, so errors
// are on the side of tracing. A shaft is blocked if a single primitive intersects all its rays.
// Margins cover the roundings of single precision, including Embree's.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "optics/vec.h"
#include "render/accel/embree.h"
#include "render/scene/scene.h"
#include "render/scene/surface_cells.h"

namespace lenticule::render {

// PrimitiveTree is a bounding volume hierarchy of a scene's primitives for conservative tests of
// ray bundles. Embree's builder makes it, since Embree does not expose the hierarchy of a committed
// scene.

/// PrimitiveTree holds boxes in the scene frame. Boxes of spheres, cones and wide triangles are a
/// margin larger than their shapes; boxes of other triangles just contain the corners. Thread
/// safety: immutable, usable from any thread.
class PrimitiveTree {
 public:
  /// Embree's geometry and primitive numbers.
  struct Leaf {
    uint32_t geometry = 0;
    uint32_t primitive = 0;
  };

  /// Builds the tree. Throws Error(Failed) with Embree's message.
  explicit PrimitiveTree(const Scene& scene);

  /// Visits the primitives whose box and all boxes around it satisfy `wanted(low, high)`, until
  /// `found(leaf)` is true for one. Returns true if one is found, false if none is, and `unsure` if
  /// the stack of pending boxes overflows.
  template <class Wanted, class Found>
  [[nodiscard]] bool search(bool unsure, const Wanted& wanted, const Found& found) const {
    if (!root_) return false;
    std::array<const Node*, 2 * size_t{kMostDepth}> waiting;
    size_t count = 0;
    waiting[count++] = root_;
    while (count > 0) {
      const Node& node = *waiting[--count];
      if (!node.child[0]) {
        if (found(node.leaf)) return true;
        continue;
      }
      for (size_t i = 0; i < 2; ++i) {
        if (!wanted(node.low[i], node.high[i])) continue;
        if (count == waiting.size()) return unsure;
        waiting[count++] = node.child[i];
      }
    }
    return false;
  }

 private:
  static constexpr unsigned kMostDepth = 64;
  /// An inner node, or a leaf if it has no children.
  struct Node {
    std::array<const Node*, 2> child{};
    std::array<Vec3f, 2> low{}, high{};
    Leaf leaf;
  };
  struct Builder;
  struct Release {
    void operator()(RTCBVH tree) const noexcept { rtcReleaseBVH(tree); }
  };

  std::unique_ptr<std::remove_pointer_t<RTCBVH>, Release> bvh_;
  const Node* root_ = nullptr;
};

// Directions are mapped to an octahedron that is unfolded to the square [-1, 1] x [-1, 1]: the
// upper half is the diamond in the middle of the square, the lower half its corners.

/// Returns the direction, not normalized, at a point of the square.
[[nodiscard]] inline Vec3f octahedron_direction(float x, float y) {
  const float z = 1.0F - std::abs(x) - std::abs(y);
  if (z >= 0.0F) return {x, y, z};
  return {std::copysign(1.0F - std::abs(y), x), std::copysign(1.0F - std::abs(x), y), z};
}

/// DirectionCell describes one of n x n equal cells of the square: a unit direction inside the cell
/// and the cosine of the angle from it to the farthest direction of the cell, reduced slightly for
/// rounding. n is even, so that the folds run through corners of cells; then the farthest direction
/// is at a corner.
struct DirectionCell {
  Vec3f middle{};
  float cosine = 1.0F;
};
[[nodiscard]] inline DirectionCell direction_cell(int u, int v, int n) {
  const float step = 2.0F / static_cast<float>(n);
  const auto at = [&](float du, float dv) {
    return normalized(octahedron_direction((static_cast<float>(u) + du) * step - 1.0F,
                                           (static_cast<float>(v) + dv) * step - 1.0F));
  };
  DirectionCell cell{.middle = at(0.5F, 0.5F)};
  for (const float du : {0.0F, 1.0F})
    for (const float dv : {0.0F, 1.0F})
      cell.cosine = std::fmin(cell.cosine, dot(cell.middle, at(du, dv)));
  cell.cosine -= 1e-5F;
  return cell;
}

/// Patch is a surface cell as the origin of rays.
struct Patch {
  Vec3f centre{};
  float radius = 0.0F;  ///< radius of a ball that contains the patch
  float extent = 0.0F;  ///< size of the primitive
  /// A flat patch lies in the plane normal . p = height; rays leave to its positive side.
  bool flat = false;
  Vec3f normal{};
  float height = 0.0F;
  /// The same plane in double precision, for tests against wide triangles.
  Vec3 exact_normal{};
  double exact_height = 0.0;
  /// Lower bound of the height above the plane of rays that leave along the plane.
  float level = 0.0F;
  /// Rays cannot meet the primitive that they leave.
  bool leaves_convex = false;
  uint32_t geometry = 0;
  uint32_t primitive = 0;
};

/// Returns the part of the surface that `cell` covers.
[[nodiscard]] Patch patch_of(const Scene& scene, const SurfaceCell& cell);

/// Result of the conservative tests of a shaft. The values are stored in two bits of the cache.
enum class ShaftResult : uint8_t {
  None = 1,     ///< unknown: rays must be traced
  Empty = 2,    ///< no ray meets anything
  Blocked = 3,  ///< each ray meets something before it reaches the light
};

/// Sizes of the scene's area lights, and length of the ambient rays, in scene units.
struct SoftSizes {
  double light_radius = 0.0;  ///< radius of point and spot lights; 0 for points
  double sun_tangent = 0.0;   ///< directional lights: tangent of the angular radius
  double around = 0.0;        ///< length of ambient rays
  friend bool operator==(const SoftSizes&, const SoftSizes&) = default;
};

/// ShaftCache answers queries for shafts: it tests a shaft at the first query and keeps the result
/// while there is space in the cache. Results depend on the scene only, not on the order of
/// queries. Thread safety: usable from any thread.
class ShaftCache {
 public:
  /// Lifetime: `scene` and its tree `tree` must outlive the object.
  ShaftCache(const Scene& scene, const PrimitiveTree& tree);
  ShaftCache(const ShaftCache&) = delete;
  ShaftCache& operator=(const ShaftCache&) = delete;

  /// Returns the cache for other light sizes than zero. The first call for given sizes allocates
  /// the cache. Lifetime: the returned cache lives as long as this object.
  [[nodiscard]] ShaftCache& with_sizes(SoftSizes sizes);
  /// Frees the caches for other sizes. No frame may be rendered meanwhile.
  void forget_sizes() { others_.clear(); }

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
  const PrimitiveTree& tree_;
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
