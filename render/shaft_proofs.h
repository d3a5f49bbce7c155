// SPDX-License-Identifier: Apache-2.0
// Remembers which shafts of a scene are empty.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "render/shaft.h"

namespace lenticule::render {

/// For any thread: what is asked for the first time is found out, and kept as long as there is
/// room. An answer depends on the scene alone, never on who asked first.
class ShaftProofs {
 public:
  /// Throws Error(Failed) with what Embree said.
  explicit ShaftProofs(const Scene::Impl& scene);

  /// A number for the cell, to ask with; below 2^50.
  [[nodiscard]] uint64_t number(const SurfaceCell& cell) const;
  /// What can be asked about a cell: below kTargets.
  static constexpr uint64_t light_target(size_t light) { return kBins + light; }
  static constexpr uint64_t direction_target(int bin_u, int bin_v) {
    return static_cast<uint64_t>(bin_u * kDirectionBins + bin_v);
  }
  static constexpr uint64_t kTargets = 2048;
  /// A place in a table of 2^bits, by Fibonacci hashing: the high bits of the product are mixed.
  static constexpr size_t mixed(uint64_t key, unsigned bits) {
    return static_cast<size_t>(key * 0x9e3779b97f4a7c15U >> (64 - bits));
  }

  /// Whether no ray from the cell meets anything on its way to the light, or in any direction of a
  /// bin (of kDirectionBins x kDirectionBins on the unfolded octahedron). `number` is the cell's.
  [[nodiscard]] bool empty(const SurfaceCell& cell, uint64_t number, uint64_t target);

 private:
  static constexpr uint64_t kBins = uint64_t{kDirectionBins} * kDirectionBins;
  static constexpr uint64_t kEmpty = 1, kPerhaps = 2;

  [[nodiscard]] bool find_out(const SurfaceCell& cell, uint64_t target) const;

  const Scene::Impl& scene_;
  ShaftTester tester_;
  std::vector<uint64_t> first_primitive_;  ///< by geometry, counted over all geometries
  /// Each a key and kEmpty or kPerhaps, or zero.
  std::vector<std::atomic<uint64_t>> answers_;
};

}  // namespace lenticule::render
