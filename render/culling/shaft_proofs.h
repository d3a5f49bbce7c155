// SPDX-License-Identifier: Apache-2.0
// Remembers which shafts of a scene are empty or blocked.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "render/culling/shaft.h"

namespace lenticule::render {

/// What is known of all rays of a shaft. The values are bits of the table of proofs.
enum class ShaftProof : uint8_t {
  None = 1,     ///< rays must be traced
  Empty = 2,    ///< none meets anything
  Blocked = 3,  ///< each meets something before it reaches the light
};

/// How large the scene's lamps are, and how far surfaces look for what is around them.
struct SoftSizes {
  double lamp_radius = 0.0;  ///< of those that stand somewhere, in scene units; 0 for points
  double sun_tangent = 0.0;  ///< of the angle at which the radius of the others is seen
  double around = 0.0;       ///< scene units
  friend bool operator==(const SoftSizes&, const SoftSizes&) = default;
};

/// For any thread: what is asked for the first time is found out, and kept as long as there is
/// room. An answer depends on the scene alone, never on who asked first.
class ShaftProofs {
 public:
  /// Both must outlive it; the tree is the scene's.
  ShaftProofs(const Scene& scene, const PrimitiveTree& tree);
  ~ShaftProofs();
  ShaftProofs(const ShaftProofs&) = delete;
  ShaftProofs& operator=(const ShaftProofs&) = delete;

  /// The same for other sizes than zero. Made when they are first asked for, which allocates, and
  /// kept as long as these are.
  [[nodiscard]] ShaftProofs& with_sizes(SoftSizes sizes);

  /// A number for a cell, to ask with; below 2^50. For `place` see render/scene/surface_cells.h.
  [[nodiscard]] uint64_t number(uint32_t geometry, uint32_t primitive, int32_t place) const {
    return (first_primitive_[geometry] + primitive) << kPlaceBits | static_cast<uint32_t>(place);
  }
  /// What can be asked about a cell: below kTargets.
  static constexpr uint64_t kBins = uint64_t{kDirectionBins} * kDirectionBins;
  static constexpr uint64_t light_target(size_t light) {
    return light < kAround - kBins ? kBins + light : kTargets;  // nothing is known of that
  }
  static constexpr uint64_t direction_target(int bin_u, int bin_v) {
    return static_cast<uint64_t>(bin_u * kDirectionBins + bin_v);
  }
  static constexpr uint64_t kTargets = 2048;
  /// Everything around, no farther than SoftSizes::around.
  static constexpr uint64_t kAround = kTargets - 1;
  /// A place in a table of 2^bits, by Fibonacci hashing: the high bits of the product are mixed.
  static constexpr size_t mixed(uint64_t key, unsigned bits) {
    return static_cast<size_t>(key * 0x9e3779b97f4a7c15U >> (64 - bits));
  }

  /// Of the rays from the cell to the light, around it, or in any direction of a bin (of
  /// kDirectionBins x kDirectionBins on the unfolded octahedron). `number` is the cell's.
  [[nodiscard]] ShaftProof proof(const SurfaceCell& cell, uint64_t number, uint64_t target);

 private:
  ShaftProofs(const ShaftProofs& points, SoftSizes sizes);
  [[nodiscard]] ShaftProof find_out(const SurfaceCell& cell, uint64_t target) const;

  const Scene& scene_;
  std::shared_ptr<const ShaftTester> tester_;
  SoftSizes sizes_;
  float sun_cosine_ = 1.0F;
  std::vector<uint64_t> first_primitive_;  ///< by geometry, counted over all geometries
  /// Each a key and a proof, or zero.
  std::vector<std::atomic<uint64_t>> answers_;
  std::mutex adding_;
  std::vector<std::unique_ptr<ShaftProofs>> others_;  ///< of other sizes
};

}  // namespace lenticule::render
