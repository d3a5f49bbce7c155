// SPDX-License-Identifier: Apache-2.0
// Background finds the parts of a tile that show only the backdrop. These parts are filled instead
// of traced.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/culling/shaft.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"
#include "render/scene/texture.h"

namespace lenticule::render {

// At depth z the rays of a beam lie between two bounds, which are straight lines on each side of
// the panel: the upper bound is a convex function of z, the lower bound a concave one. So the
// points beyond one bound form a convex set, and a shape lies in this set if its corners do.
inline double upper(const Interval& at_panel, const Interval& slope, double z) {
  return at_panel.high + std::max(slope.low * z, slope.high * z);
}

inline double lower(const Interval& at_panel, const Interval& slope, double z) {
  return at_panel.low + std::min(slope.low * z, slope.high * z);
}

/// Returns true if all corners of a flat shape lie beside the rays, in front of their start or
/// behind it.
template <size_t N>
bool beside_corners(const Beam& beam, const std::array<Vec3, N>& corners, double room) {
  const auto all = [&](const auto& holds) { return std::ranges::all_of(corners, holds); };
  return all([&](Vec3 p) { return p.x - room > upper(beam.x_mm, beam.tan_x, p.z); }) ||
         all([&](Vec3 p) { return p.x + room < lower(beam.x_mm, beam.tan_x, p.z); }) ||
         all([&](Vec3 p) { return p.y - room > upper(beam.y_mm, beam.tan_y, p.z); }) ||
         all([&](Vec3 p) { return p.y + room < lower(beam.y_mm, beam.tan_y, p.z); });
}

/// BeamTester tests beams against one scene. Lifetime: the scene must outlive the object. Thread
/// safety: usable from any thread.
class BeamTester {
 public:
  explicit BeamTester(const Scene& scene)
      : scene_(scene),
        panel_from_scene_(scene.scene_from_panel.inverse()),
        offset_(length(scene.scene_from_panel.origin)) {
    // Embree computes in the scene frame, where numbers may be larger. Much larger numbers may be
    // invalid for Embree, and their rays stay black.
    double stretch = 0.0;
    for (const Affine& map : {scene.scene_from_panel, panel_from_scene_})
      for (const Vec3& column : {map.column_x, map.column_y, map.column_z})
        stretch = std::max(stretch, length(column));
    const auto size = [](Vec3 v) { return Vec3{std::abs(v.x), std::abs(v.y), std::abs(v.z)}; };
    const auto& [x, y, z, origin] = panel_from_scene_;
    extent_from_scene_ = {size(x), size(y), size(z)};
    margin_ = double{kRoundingMargin} * stretch;
    constexpr double kMostStretch = 1e6;
    usable_ = scene.tree != nullptr && stretch < kMostStretch;
  }

  /// Returns false if no beam can be tested: the scene has too many primitives for a tree, or the
  /// stage scales its depth by more than a factor of a million.
  [[nodiscard]] bool usable() const { return usable_; }

  /// Returns true if no ray of the beam meets anything, including Embree's rounding errors; false
  /// if a ray may meet something.
  [[nodiscard]] bool empty(const Beam& beam) const {
    if (!usable_) return false;
    if (!(beam.x_mm.low <= beam.x_mm.high)) return true;  // the beam has no rays
    return !scene_.tree->search(
        true, [&](Vec3f low, Vec3f high) { return !misses_box(beam, low, high); },
        [&](const PrimitiveTree::Leaf& leaf) { return !misses_primitive(beam, leaf); });
  }

 private:
  /// Returns the size to which Embree's intersection error is proportional: coordinates as seen
  /// from the start of a ray.
  [[nodiscard]] double sum_of_sizes(const Beam& beam, double coordinates) const {
    return coordinates + offset_ + std::abs(beam.start_mm) + beam.x_mm.largest() +
           beam.y_mm.largest();
  }

  /// Returns true if the range `shape` at depths z lies outside the beam, along one axis of the
  /// panel.
  static bool beside(const Interval& at_panel, const Interval& slope, Interval shape, Interval z) {
    return shape.low > std::max(upper(at_panel, slope, z.low), upper(at_panel, slope, z.high)) ||
           shape.high < std::min(lower(at_panel, slope, z.low), lower(at_panel, slope, z.high));
  }

  [[nodiscard]] Vec3 on_panel(Vec3f point) const { return panel_from_scene_.point(Vec3(point)); }
  /// Tests the box around a box of the scene frame.
  [[nodiscard]] bool misses_box(const Beam& beam, Vec3f low, Vec3f high) const {
    const Vec3 half = extent_from_scene_.vector((Vec3(high) - Vec3(low)) * 0.5);
    const Vec3 a = on_panel(low + (high - low) * 0.5F) - half, b = a + half * 2.0;
    const double room = margin_ * sum_of_sizes(beam, std::max(largest_size(a), largest_size(b)));
    Interval z = Interval{a.z, b.z}.widened(room);
    if (z.low > beam.start_mm) return true;
    z.high = std::min(z.high, beam.start_mm);
    return beside(beam.x_mm, beam.tan_x, Interval{a.x, b.x}.widened(room), z) ||
           beside(beam.y_mm, beam.tan_y, Interval{a.y, b.y}.widened(room), z);
  }
  /// Tests a primitive more closely than its box.
  [[nodiscard]] bool misses_primitive(const Beam& beam, const PrimitiveTree::Leaf& leaf) const {
    const GeometryEntry& entry = scene_.geometries[leaf.geometry];
    if (entry.kind != GeometryEntry::Kind::Mesh) return false;
    const auto [a, b, c] = scene_.meshes[entry.mesh].corners(leaf.primitive);
    const std::array<Vec3, 3> corners_mm = {on_panel(a), on_panel(b), on_panel(c)};
    const double size = std::max(
        {largest_size(corners_mm[0]), largest_size(corners_mm[1]), largest_size(corners_mm[2])});
    const double room = margin_ * sum_of_sizes(beam, size);
    const auto in_front = [&](Vec3 p) { return p.z > beam.start_mm + room; };
    return std::ranges::all_of(corners_mm, in_front) || beside_corners(beam, corners_mm, room);
  }

  const Scene& scene_;
  bool usable_ = false;
  Affine panel_from_scene_;
  Affine extent_from_scene_;  ///< without signs: maps half the size of a box
  double offset_;             ///< distance of the panel's centre from the origin of the scene frame
  double margin_ = 0.0;       ///< allowance for rounding, relative to sizes
};

/// Returns true if no ray of the beam, or of its extension toward the viewer, crosses the ground
/// where the scene's shadow falls. The scene must have one.
[[nodiscard]] inline bool misses_ground_shadow(const Scene& scene, const Beam& beam) {
  const GroundShadow& shadow = *scene.backdrop.ground_shadow;
  // The shadow fades out before its border.
  return beside_corners(beam, shadow.corners(scene.scene_from_panel.inverse()), 0.0);
}

/// Background fills parts of tiles. Thread safety: used by one thread. It keeps its memory from
/// tile to tile.
class Background {
 public:
  Background() : packets_(kFewPackets) {
    static_assert(kPartColumns % kFewPackets == 0);
    init_packets(packets_);
  }

  /// Run of a tile's columns.
  struct Run {
    ColumnRange columns;
    bool empty = false;  ///< no ray of these columns meets anything
  };
  /// Returns the runs of the tile that `maker` was started with, from left to right.
  [[nodiscard]] std::span<const Run> runs(const BeamTester& tester,
                                          const PrimaryPackets::Maker& maker) {
    run_count_ = 0;
    const Run whole{{0, TilePlan::kColumns}, false};
    std::array<Beam, kParts> beams;
    Beam all;
    bool known = tester.usable();
    for (int p = 0; p < kParts && known; ++p) {
      Beam& beam = beams[static_cast<size_t>(p)];
      known = maker.beam({p * kPartColumns, (p + 1) * kPartColumns}, beam);
      all.extend(beam);
    }
    if (!known) {
      add_run(whole);
    } else if (tester.empty(all)) {
      add_run({whole.columns, true});
    } else {
      for (int p = 0; p < kParts; ++p)
        add_run({{p * kPartColumns, (p + 1) * kPartColumns},
                 tester.empty(beams[static_cast<size_t>(p)])});
    }
    return {runs_.data(), run_count_};
  }

  /// Adds to light[row * tile.columns + column] the light that PacketTracer::trace would add for
  /// rays that meet nothing. The calling thread must flush denormals.
  void fill(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
            double weight, PrimaryPackets::Maker& maker, std::span<float> light) {
    filled_ += maker.count(columns);
    const auto each = static_cast<float>(weight);
    if (sees_one_light(scene, maker, columns))
      return fill_flat(scene, plan, tile, columns, each, light);
    maker.prepare(packets_);
    for (int first = columns.begin; first < columns.end; first += kPartColumns) {
      const ColumnRange part{first, std::min(first + kPartColumns, columns.end)};
      if (sees_one_light(scene, maker, part))
        fill_flat(scene, plan, tile, part, each, light);
      else
        fill_by_ray(scene, plan, tile, part, each, maker, light);
    }
  }

  /// Returns the number of rays that were filled instead of traced.
  [[nodiscard]] uint64_t filled() const { return filled_; }

 private:
  static constexpr int kFewPackets = 8;

  static int channel_at(const TilePlan& plan, const Tile& tile, int column, int row) {
    // Subpixels to the left of the panel have negative numbers.
    return (plan.subpixel(tile, column, row) % 3 + 3) % 3;
  }

  static void fill_flat(const Scene& scene, const TilePlan& plan, const Tile& tile,
                        ColumnRange columns, float weight, std::span<float> light) {
    for (int row = 0; row < TilePlan::kRows; ++row) {
      float* out = light.data() + static_cast<size_t>(row * tile.columns);
      for (int first = columns.begin; first < columns.begin + 3; ++first) {
        const int channel = channel_at(plan, tile, first, row);
        const float more = weight * static_cast<float>(component(scene.backdrop.colour, channel));
        for (int column = first; column < columns.end; column += 3) out[column] += more;
      }
    }
  }

  /// Returns true if all rays of the columns see the colour of the backdrop.
  static bool sees_one_light(const Scene& scene, const PrimaryPackets::Maker& maker,
                             ColumnRange columns) {
    Beam beam;
    return scene.backdrop.flat() || (scene.backdrop.ground_shadow && maker.beam(columns, beam) &&
                                     misses_ground_shadow(scene, beam));
  }
  /// Columns per test, about six lenses of common sheets: narrow enough to fit gaps between
  /// objects, and wide enough to keep the tests cheap.
  static constexpr int kPartColumns = 48;
  static constexpr int kParts = TilePlan::kColumns / kPartColumns;
  static_assert(TilePlan::kColumns % kPartColumns == 0);

  void add_run(Run run) {
    if (run_count_ > 0 && runs_[run_count_ - 1].empty == run.empty)
      runs_[run_count_ - 1].columns.end = run.columns.end;
    else
      runs_[run_count_++] = run;
  }
  void fill_by_ray(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
                   float weight, PrimaryPackets::Maker& maker, std::span<float> light) {
    static_assert(TilePlan::kRows == kPacket);
    std::array<int32_t, kPacket> channel;
    std::array<float, kPacket> seen;
    for (int column = columns.begin; column < columns.end; column += kFewPackets) {
      maker.columns(column, packets_);
      for (int k = 0; k < kFewPackets; ++k) {
        const RayPacket& packet = packets_[static_cast<size_t>(k)];
        const uint32_t lanes = lane_bits(packet.valid);
        for (int row = 0; row < TilePlan::kRows; ++row)
          channel[static_cast<size_t>(row)] = channel_at(plan, tile, column + k, row);
        light_beyond_packet(scene.backdrop, packet, lanes, channel, seen);
        for (uint32_t left = lanes; left != 0; left &= left - 1) {
          const auto r = static_cast<size_t>(std::countr_zero(left));
          light[r * static_cast<size_t>(tile.columns) + static_cast<size_t>(column + k)] +=
              weight * seen[r];
        }
      }
    }
  }

  std::array<Run, kParts> runs_;
  size_t run_count_ = 0;
  std::vector<RayPacket> packets_;
  uint64_t filled_ = 0;
};

}  // namespace lenticule::render
