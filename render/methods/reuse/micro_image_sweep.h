// SPDX-License-Identifier: Apache-2.0
// Fills the micro-images of a tile: by tracing, from each other's points, or by the mean of two.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "optics/model.h"
#include "render/integrator/packet_tracer.h"
#include "render/methods/reuse/lens_numbers.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/options/reuse_options.h"
#include "render/rays/primary_packets.h"
#include "render/rays/tile.h"

namespace lenticule::render {

/// What one rig needs once; immutable, safe from any thread.
struct SweepPlan {
  /// The model must outlive it.
  SweepPlan(const optics::OpticalModel& model, const RenderOptions& options);
  SweepPlan(const SweepPlan&) = delete;
  SweepPlan& operator=(const SweepPlan&) = delete;

  TilePlan tiles;
  PrimaryPackets packets;
  LensNumbers lenses;
  const reprojection::Kernel& kernel;
  reprojection::Rules rules;
  Footprint centre;  ///< of subpixels, where their rays leave
};

/// Of one thread and one scene; keeps its memory from tile to tile. Calling thread must flush
/// denormals.
class MicroImageSweep {
 public:
  /// Both must outlive it.
  MicroImageSweep(const SweepPlan& plan, const RenderOptions& options);

  /// Makes the rays of a tile; all its subpixels are empty then.
  void start(const Scene& scene, const Tile& tile);

  /// Micro-images are made one from another; what stays empty is traced.
  void lens_view();
  /// Odd ones by lens_view() among themselves, even ones from the odd ones beside them; what stays
  /// empty in those gets the mean of what these show at the same place, or is traced if there are
  /// no two.
  void interpolate();
  /// For tiles in which some points are known already: what is empty is looked for in the
  /// micro-images on both sides.
  void fill_from_neighbours();
  /// Counts what is empty as missing.
  void note_empty();
  /// What is empty gets the mean of both neighbours, where they are there.
  void fill_with_means();
  void trace_empty();

  /// The tile's columns; whoever puts points there sets their flags.
  [[nodiscard]] std::span<reprojection::Column> columns() { return columns_; }
  [[nodiscard]] PacketTracer& tracer() { return tracer_; }

 private:
  using Lanes = std::array<int32_t, kPacket>;
  /// Which lenses a column is made from, lane by lane, and how much counts the right one.
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
  /// Empty lanes whose lens is one of first, first + step, ...; -1 each.
  [[nodiscard]] bool empty_lanes(int column, int step, int first, Lanes& lanes) const;
  void sweep(int step, int first);
  void sweep_chain(int step, int first);
  void sweep_between_keys(int step, int first);
  /// From other micro-images, and what stays empty by tracing.
  void make(int column, int step, const Lanes& lanes);
  [[nodiscard]] int beyond_key(int lens, int step) const;
  /// Splits lanes into those to be traced and those to be made from others.
  void take_keys(int column, int step, Lanes& lanes, Lanes& keys) const;
  void sides_of(int column, int step, const Lanes& lanes, Sides& sides) const;
  void project(int column, const Lanes& lanes, const Sides& sides);
  void look(int column, const Lanes& lanes, const Lanes& lenses, reprojection::Found& found) const;
  void note_missing(int column, const Lanes& lanes);
  void mean(int column, const Lanes& lanes);
  /// Puts empty lanes into the queue, which is traced when sixteen are in it.
  void trace(int column, const Lanes& lanes);
  void flush();
  void take(size_t queued, float light);
  [[nodiscard]] int32_t surface_of(uint32_t geometry, uint32_t primitive, int number) const;
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
  /// Rays of any columns that wait to be traced: full packets cost little more than empty ones.
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
