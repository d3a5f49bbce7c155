// SPDX-License-Identifier: Apache-2.0
// Parts of a tile that show nothing but what lies behind the scene: they are filled, not traced.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/culling/beam_tester.h"
#include "render/rays/primary_packets.h"

namespace lenticule::render {

/// Of one thread; keeps its memory from tile to tile.
class Background {
 public:
  Background();

  /// Runs of a tile's columns, from left to right.
  struct Run {
    ColumnRange columns;
    bool empty = false;  ///< no ray of theirs meets anything
  };
  /// Of the tile that `maker` was started with.
  [[nodiscard]] std::span<const Run> runs(const BeamTester& tester,
                                          const PrimaryPackets::Maker& maker);

  /// Adds to light[row * tile.columns + column] what PacketTracer::trace would for rays that meet
  /// nothing. Calling thread must flush denormals.
  void fill(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
            double weight, PrimaryPackets::Maker& maker, std::span<float> light);

  /// Rays that were not traced.
  [[nodiscard]] uint64_t filled() const { return filled_; }

 private:
  /// Six lenses of common sheets: narrow enough for the gaps between things, and wide enough for
  /// asking to cost little.
  static constexpr int kPartColumns = 48;
  static constexpr int kParts = TilePlan::kColumns / kPartColumns;
  static_assert(TilePlan::kColumns % kPartColumns == 0);

  void add_run(Run run);

  std::array<Run, kParts> runs_;
  size_t run_count_ = 0;
  std::vector<RayPacket> packets_;
  uint64_t filled_ = 0;
};

}  // namespace lenticule::render
