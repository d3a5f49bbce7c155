// SPDX-License-Identifier: Apache-2.0
// MicroImageSweep fills the micro-images of a tile by tracing, by re-projecting points of other
// micro-images, or by the mean of two neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "optics/model.h"
#include "render/integrator/packet_tracer.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"

namespace lenticule::render {

/// LensNumbers maps rays of one rig to lens numbers. Thread safety: immutable after construction,
/// usable from any thread.
class LensNumbers {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  LensNumbers(const optics::OpticalModel& model, const TilePlan& plan);

  struct Line {
    double offset = 0.0;
    double per_mm = 0.0;
  };
  /// Returns the line lens = offset + per_mm x, valid for apex lines near x in one row.
  [[nodiscard]] Line line_at(int row, int channel, double x_mm) const;

  /// Lens maps for columns c, c + 3, ... of a tile, by c mod 3, since the channels of the lanes
  /// repeat.
  using Maps = std::array<reprojection::LensMap, 3>;
  void expand(const Tile& tile, Maps& maps) const;

 private:
  [[nodiscard]] Line line(int row, int channel, int left_px, int right_px) const;

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  bool straight_;            ///< all lenses have the same width
  std::vector<Line> lines_;  ///< [row][channel], if straight_
};

/// SweepPlan holds the data that depends on the rig only. Thread safety: immutable, usable from any
/// thread.
struct SweepPlan {
  /// Lifetime: the model must outlive the object.
  SweepPlan(const optics::OpticalModel& model, const RenderOptions& options);
  SweepPlan(const SweepPlan&) = delete;
  SweepPlan& operator=(const SweepPlan&) = delete;

  TilePlan tiles;
  PrimaryPackets packets;
  LensNumbers lenses;
  const reprojection::Kernel& kernel;
  reprojection::Rules rules;
  Footprint centre;  ///< subpixel centres, where rays start
};

/// MicroImageSweep renders tiles of one scene. The calling thread must flush denormals. Thread
/// safety: used by one thread. It keeps its memory from tile to tile.
class MicroImageSweep {
 public:
  /// Lifetime: `plan` must outlive the object.
  MicroImageSweep(const SweepPlan& plan, const RenderOptions& options);

  /// Makes the rays of a tile and marks all its subpixels empty.
  void start(const Scene& scene, const Tile& tile);

  /// Makes each micro-image from others; subpixels that stay empty are traced.
  void lens_view();
  /// Makes the odd micro-images by lens_view() among themselves, and the even ones from their odd
  /// neighbours. A subpixel that stays empty in an even one gets the mean of the neighbours at the
  /// same place, or is traced if there are not two neighbours.
  void interpolate();
  /// Fills the empty subpixels of a tile in which some points are already known from the
  /// micro-images on both sides.
  void fill_from_neighbours();
  /// Counts empty subpixels as missing.
  void note_empty();
  /// Fills empty subpixels with the mean of both neighbours, if both exist.
  void fill_with_means();
  void trace_empty();

  /// Returns the tile's columns. A caller that adds points also sets their flags.
  [[nodiscard]] std::span<reprojection::Column> columns() { return columns_; }
  [[nodiscard]] PacketTracer& tracer() { return tracer_; }

 private:
  using Lanes = std::array<int32_t, kPacket>;
  /// Sides holds, per lane of a column, the two lenses to take points from and the weight of the
  /// right one.
  struct Sides {
    alignas(64) Lanes left;
    alignas(64) Lanes right;
    alignas(64) std::array<float, kPacket> part;
  };
  struct Range {
    int first = 0;
    int end = 0;
  };

  void find_ranges();
  [[nodiscard]] Range range_of(const Lanes& lenses, const Lanes& lanes, int column) const;
  /// Finds the empty lanes whose lens is one of first, first + step, ...; -1 each.
  [[nodiscard]] bool empty_lanes(int column, int step, int first, Lanes& lanes) const;
  /// Calls act(column, lanes) for each column, from left to right, that has empty lanes of
  /// empty_lanes(). `lanes` may be changed.
  template <class Act>
  void each_empty(int step, int first, const Act& act);
  void sweep(int step, int first);
  void sweep_chain(int step, int first);
  void sweep_between_keys(int step, int first);
  /// Fills lanes from other micro-images, and traces those that stay empty.
  void make(int column, int step, const Lanes& lanes);
  [[nodiscard]] int beyond_key(int lens, int step) const;
  /// Splits lanes into those to trace (`keys`) and those to make from other micro-images.
  void take_keys(int column, int step, Lanes& lanes, Lanes& keys) const;
  void sides_of(int column, int step, const Lanes& lanes, Sides& sides) const;
  void project(int column, const Lanes& lanes, const Sides& sides);
  void look(int column, const Lanes& lanes, const Lanes& lenses, reprojection::Found& found) const;
  void note_missing(int column, const Lanes& lanes);
  void mean(int column, const Lanes& lanes);
  /// Adds empty lanes to the queue, which is traced when it holds sixteen.
  void trace(int column, const Lanes& lanes);
  void flush();
  void take(size_t queued, float light);
  [[nodiscard]] int32_t surface_of(uint32_t geometry, uint32_t primitive) const;
  void join(int column);
  void join_all();

  const SweepPlan& plan_;
  ReuseOptions options_;
  PrimaryPackets::Maker maker_;
  PacketTracer tracer_;
  const Scene* scene_ = nullptr;
  Tile tile_;
  reprojection::PanelMap panel_{};
  LensNumbers::Maps lens_maps_;
  std::vector<RayPacket> packets_;
  std::vector<reprojection::Column> columns_;
  /// Queue collects rays of any columns until a packet is full, since a full packet costs little
  /// more than a sparse one.
  struct Queue {
    reprojection::Column rays;
    RayPacket packet;
    std::array<int, kPacket> column;
    std::array<size_t, kPacket> lane;
    std::array<int32_t, kPacket> channel;
    std::array<uint32_t, kPacket> seed;
    size_t count = 0;
  };
  Queue queue_;
  int lens_base_ = 0;
  std::vector<Range> ranges_;  ///< columns that have a subpixel under lens lens_base_ + index
};

}  // namespace lenticule::render
