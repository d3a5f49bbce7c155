// SPDX-License-Identifier: Apache-2.0
// Background finds the parts of a tile that show only the backdrop. These parts are filled instead
// of traced.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/culling/shaft.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"

namespace lenticule::render {

/// BeamTester tests beams against one scene. Lifetime: the scene must outlive the object. Thread
/// safety: usable from any thread.
class BeamTester {
 public:
  explicit BeamTester(const Scene& scene);

  /// Returns false if no beam can be tested: the scene has too many primitives for a tree, or the
  /// stage shears it or scales its depth by more than a factor of a million.
  [[nodiscard]] bool usable() const { return usable_; }

  /// Returns true if no ray of the beam meets anything, including Embree's rounding errors; false
  /// if a ray may meet something.
  [[nodiscard]] bool empty(const Beam& beam) const;

 private:
  [[nodiscard]] Vec3 on_panel(Vec3f point) const;
  [[nodiscard]] bool misses_box(const Beam& beam, Vec3f low, Vec3f high) const;
  [[nodiscard]] bool misses_primitive(const Beam& beam, const PrimitiveTree::Leaf& leaf) const;

  const Scene& scene_;
  bool usable_ = false;
  Vec3 panel_per_scene_;  ///< panel units per scene unit, along each axis
  double margin_ = 0.0;   ///< allowance for rounding, relative to sizes
};

/// Returns true if no ray of the beam, or of its extension toward the viewer, crosses the ground
/// where the scene's shadow falls. The scene must have one.
[[nodiscard]] bool misses_ground_shadow(const Scene& scene, const Beam& beam);

/// Background fills parts of tiles. Thread safety: used by one thread. It keeps its memory from
/// tile to tile.
class Background {
 public:
  Background();

  /// Run of a tile's columns.
  struct Run {
    ColumnRange columns;
    bool empty = false;  ///< no ray of these columns meets anything
  };
  /// Returns the runs of the tile that `maker` was started with, from left to right.
  [[nodiscard]] std::span<const Run> runs(const BeamTester& tester,
                                          const PrimaryPackets::Maker& maker);

  /// Adds to light[row * tile.columns + column] the light that PacketTracer::trace would add for
  /// rays that meet nothing. The calling thread must flush denormals.
  void fill(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
            double weight, PrimaryPackets::Maker& maker, std::span<float> light);

  /// Returns the number of rays that were filled instead of traced.
  [[nodiscard]] uint64_t filled() const { return filled_; }

 private:
  /// Columns per test, about six lenses of common sheets: narrow enough to fit gaps between
  /// objects, and wide enough to keep the tests cheap.
  static constexpr int kPartColumns = 48;
  static constexpr int kParts = TilePlan::kColumns / kPartColumns;
  static_assert(TilePlan::kColumns % kPartColumns == 0);

  void add_run(Run run);
  void fill_by_ray(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
                   float weight, PrimaryPackets::Maker& maker, std::span<float> light);

  std::array<Run, kParts> runs_;
  size_t run_count_ = 0;
  std::vector<RayPacket> packets_;
  uint64_t filled_ = 0;
};

}  // namespace lenticule::render
