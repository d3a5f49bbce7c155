// SPDX-License-Identifier: Apache-2.0
// MicroImageSweep fills the micro-images of a tile by tracing, by re-projecting points of other
// micro-images, or by the mean of two neighbours.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "frames/srgb.h"
#include "optics/model.h"
#include "render/integrator/packet_tracer.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// LensNumbers maps rays of one rig to lens numbers. Thread safety: immutable after construction,
/// usable from any thread.
class LensNumbers {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  LensNumbers(const optics::OpticalModel& model, const TilePlan& plan)
      : model_(model), plan_(plan), straight_(model.rig().sheet.residual.empty()) {
    if (!straight_) return;
    const optics::Panel& panel = model.rig().panel;
    lines_.reserve(static_cast<size_t>(panel.height_px) * 3);
    for (int row = 0; row < panel.height_px; ++row)
      for (int channel = 0; channel < 3; ++channel)
        lines_.push_back(line(row, channel, panel.width_px / 2, panel.width_px / 2));
  }

  struct Line {
    double offset = 0.0;
    double per_mm = 0.0;
  };
  /// Returns the line lens = offset + per_mm x, valid for apex lines near x in one row.
  [[nodiscard]] Line line_at(int row, int channel, double x_mm) const {
    if (straight_) return lines_[static_cast<size_t>(3 * row + channel)];
    constexpr int kNear = 32;
    const optics::Panel& panel = model_.rig().panel;
    const int last_px = panel.width_px - 1;
    const int px = std::clamp(static_cast<int>(panel.x_px(x_mm)), 0, last_px);
    return line(row, channel, std::max(px - kNear, 0), std::min(px + kNear, last_px));
  }

  /// Lens maps for columns c, c + 3, ... of a tile, by c mod 3, since the channels of the lanes
  /// repeat.
  using Maps = std::array<reprojection::LensMap, 3>;
  void expand(const Tile& tile, Maps& maps) const {
    const optics::Panel& panel = model_.rig().panel;
    for (int k = 0; k < 3; ++k)
      for (int lane = 0; lane < TilePlan::kRows; ++lane) {
        const int row = std::min(tile.row_begin + lane, panel.height_px - 1);
        const int first = plan_.subpixel(tile, 0, lane);
        const int channel = ((first + k) % 3 + 3) % 3;
        const int last_px = panel.width_px - 1;
        const Line found = straight_ ? lines_[static_cast<size_t>(3 * row + channel)]
                                     : line(row, channel, std::clamp(first / 3, 0, last_px),
                                            std::clamp((first + tile.columns) / 3, 0, last_px));
        reprojection::LensMap& map = maps[static_cast<size_t>(k)];
        map.offset[lane] = static_cast<float>(found.offset);
        map.per_mm[lane] = static_cast<float>(found.per_mm);
      }
  }

 private:
  /// Fits the line through two rays. Rays pass the panel on the apex line of their lens, which is a
  /// point in one row. A residual map shifts these points; over the width of a tile the shift is
  /// close enough to linear.
  [[nodiscard]] Line line(int row, int channel, int left_px, int right_px) const {
    const optics::SubpixelRay left = model_.ray(left_px, row, channel);
    const optics::SubpixelRay right = model_.ray(right_px, row, channel);
    Line line{.per_mm = 1.0 / model_.pitch_mm()};
    if (right.lens != left.lens)
      line.per_mm =
          static_cast<double>(right.lens - left.lens) / (right.lens_x_mm - left.lens_x_mm);
    line.offset = static_cast<double>(left.lens) - line.per_mm * left.lens_x_mm;
    return line;
  }

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  bool straight_;            ///< all lenses have the same width
  std::vector<Line> lines_;  ///< [row][channel], if straight_
};

/// Largest difference in code values between the points of a chord, or between two neighbours.
/// Chosen by measurement.
inline constexpr float kAgreement = 16.0F;

/// SweepPlan holds the data that depends on the rig only. Thread safety: immutable, usable from any
/// thread.
struct SweepPlan {
  /// Lifetime: the model must outlive the object.
  SweepPlan(const optics::OpticalModel& model, const RenderOptions& options)
      : tiles(model.rig()),
        packets(model, tiles, options.isa),
        lenses(model, tiles),
        kernel(LENTICULE_SELECT_KERNEL(options.isa, kReprojectionKernel)),
        rules(rules_of(model.rig())),
        centre(model, {}) {}
  SweepPlan(const SweepPlan&) = delete;
  SweepPlan& operator=(const SweepPlan&) = delete;

  static reprojection::Rules rules_of(const optics::Rig& rig) {
    const double gap_mm = rig.sheet.gap.value;
    return {
        .steepest = 4.0F,
        .agreement = kAgreement,
        .slot_tan = gap_mm > 0.0 ? static_cast<float>(rig.panel.pixel_width.value / gap_mm) : 0.0F,
        .one_side = true};
  }

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
  MicroImageSweep(const SweepPlan& plan, const RenderOptions& options)
      : plan_(plan),
        maker_(plan.packets),
        tracer_(options),
        packets_(kPacketsAtOnce),
        columns_(TilePlan::kColumns) {
    init_packets(packets_);
    init_packets({&queue_.packet, 1});
  }

  /// Makes the rays of a tile and marks all its subpixels empty.
  void start(const Scene& scene, const Tile& tile) {
    scene_ = &scene;
    tile_ = tile;
    panel_ = panel_map(scene);
    plan_.lenses.expand(tile, lens_maps_);
    maker_.start(scene, tile, plan_.centre);
    maker_.prepare(packets_);
    for (int column = 0; column < tile.columns; column += kPacketsAtOnce) {
      maker_.columns(column, packets_);
      for (int k = 0; k < kPacketsAtOnce; ++k) {
        const RayPacket& packet = packets_[static_cast<size_t>(k)];
        Column& out = columns_[static_cast<size_t>(column + k)];
        plan_.kernel.place(panel_, lens_maps_[static_cast<size_t>((column + k) % kChannels)],
                           &packet.rays.ray.org_x[0], out);
        for (size_t r = 0; r < kPacket; ++r)
          out.flag[r] = packet.valid[r] != 0 ? reprojection::kEmpty : reprojection::kOutside;
      }
    }

    find_ranges();
  }

  /// Makes each micro-image from others; subpixels that stay empty are traced.
  void lens_view() { sweep(1, 0); }
  /// Makes the odd micro-images by lens_view() among themselves, and the even ones from their odd
  /// neighbours. A subpixel that stays empty in an even one gets the mean of the neighbours at the
  /// same place, or is traced if there are not two neighbours.
  void interpolate() {
    sweep(2, 1);
    fill_from_neighbours();
    fill_with_means();
    trace_empty();
  }
  /// Fills the empty subpixels of a tile in which some points are already known from the
  /// micro-images on both sides.
  void fill_from_neighbours() {
    join_all();
    each_empty(1, 0, [&](int column, Lanes& lanes) {
      project(column, lanes, neighbours_of(column, 1));
      note_missing(column, lanes);
    });
  }
  /// Counts empty subpixels as missing.
  void note_empty() {
    each_empty(1, 0, [&](int column, Lanes& lanes) { note_missing(column, lanes); });
  }
  /// Fills empty subpixels with the mean of both neighbours, if both exist.
  void fill_with_means() {
    each_empty(1, 0, [&](int column, Lanes& lanes) { mean(column, lanes); });
  }
  void trace_empty() {
    each_empty(1, 0, [&](int column, Lanes& lanes) { trace(column, lanes); });
    flush();
  }

  /// Returns the tile's columns. A caller that adds points also sets their flags.
  [[nodiscard]] std::span<reprojection::Column> columns() { return columns_; }
  [[nodiscard]] PacketTracer& tracer() { return tracer_; }

 private:
  using Column = reprojection::Column;
  using Found = reprojection::Found;
  static constexpr int kChannels = reprojection::kChannels;
  static_assert(reprojection::kLanes == kPacket);
  static constexpr int kPacketsAtOnce = 8;
  static_assert(TilePlan::kColumns % kPacketsAtOnce == 0);

  static reprojection::PanelMap panel_map(const Scene& scene) {
    const Affine panel = scene.scene_from_panel.inverse();
    const auto f = [](double value) { return static_cast<float>(value); };
    const auto& [x, y, z, origin] = panel;
    return {.x = {f(x.x), f(y.x), f(z.x), f(origin.x)}, .z = {f(x.z), f(y.z), f(z.z), f(origin.z)}};
  }

  /// Returns the code value as method full writes it.
  static float code_of(float light, bool colour_managed) {
    return static_cast<float>(colour_managed ? frames::code_from_linear(double{light})
                                             : frames::code_from_encoded(light));
  }

  using Lanes = std::array<int32_t, kPacket>;
  static bool any(const Lanes& lanes) {
    int32_t all = 0;
    for (const int32_t lane : lanes) all |= lane;
    return all != 0;
  }

  /// Sides holds, per lane of a column, the two lenses to take points from and the weight of the
  /// right one.
  struct Sides {
    alignas(64) Lanes left;
    alignas(64) Lanes right;
    alignas(64) std::array<float, kPacket> part;
  };
  [[nodiscard]] Sides neighbours_of(int column, int step) const {
    Sides sides;
    for (size_t r = 0; r < kPacket; ++r) {
      const int lens = columns_[static_cast<size_t>(column)].lens[r];
      sides.left[r] = lens - step;
      sides.right[r] = lens + step;
      sides.part[r] = 0.5F;
    }
    return sides;
  }
  struct Range {
    int first = 0;
    int end = 0;
  };

  void find_ranges() {
    int low = std::numeric_limits<int>::max(), high = std::numeric_limits<int>::min();
    const auto each = [this](auto&& act) {
      for (size_t c = 0; c < columns_.size(); ++c)
        for (size_t r = 0; r < kPacket; ++r)
          if (columns_[c].flag[r] != reprojection::kOutside)
            act(static_cast<int>(c), columns_[c].lens[r]);
    };
    each([&](int, int lens) {
      low = std::min(low, lens);
      high = std::max(high, lens);
    });
    lens_base_ = low;
    ranges_.assign(low <= high ? static_cast<size_t>(high - low) + 1 : 0, {tile_.columns, 0});
    each([&](int column, int lens) {
      Range& range = ranges_[static_cast<size_t>(lens - lens_base_)];
      range.first = std::min(range.first, column);
      range.end = std::max(range.end, column + 1);
    });
  }
  /// Returns the columns of `column`'s channels that contain the lanes' lenses.
  [[nodiscard]] Range range_of(const Lanes& lenses, const Lanes& lanes, int column) const {
    Range all{tile_.columns, 0};
    int last = std::numeric_limits<int>::min();
    for (size_t r = 0; r < kPacket; ++r) {
      if (lanes[r] == 0 || lenses[r] == last) continue;
      last = lenses[r];
      const int index = last - lens_base_;
      if (index < 0 || index >= static_cast<int>(ranges_.size())) continue;
      all.first = std::min(all.first, ranges_[static_cast<size_t>(index)].first);
      all.end = std::max(all.end, ranges_[static_cast<size_t>(index)].end);
    }

    const int behind = ((column - all.first) % kChannels + kChannels) % kChannels;
    return {all.first + behind, all.end};
  }
  /// Finds the empty lanes whose lens is one of first, first + step, ...; -1 each.
  [[nodiscard]] bool empty_lanes(int column, int step, int first, Lanes& lanes) const {
    const Column& c = columns_[static_cast<size_t>(column)];
    for (size_t r = 0; r < kPacket; ++r) {
      const int32_t of_step = ((c.lens[r] ^ first) & (step - 1)) == 0 ? -1 : 0;
      lanes[r] = c.flag[r] == reprojection::kEmpty ? of_step : 0;
    }
    return any(lanes);
  }
  /// Calls act(column, lanes) for each column, from left to right, that has empty lanes of
  /// empty_lanes(). `lanes` may be changed.
  template <class Act>
  void each_empty(int step, int first, const Act& act) {
    alignas(64) Lanes lanes;
    for (int column = 0; column < tile_.columns; ++column)
      if (empty_lanes(column, step, first, lanes)) act(column, lanes);
  }
  void sweep(int step, int first) {
    each_empty(step, first, [&](int column, Lanes& lanes) {
      alignas(64) Lanes keys;
      take_keys(column, step, lanes, keys);
      trace(column, keys);
    });
    flush();
    join_all();
    each_empty(step, first, [&](int column, Lanes& lanes) { make(column, step, lanes); });
    flush();
  }
  /// Fills lanes from other micro-images, and traces those that stay empty.
  void make(int column, int step, const Lanes& lanes) {
    if (!any(lanes)) return;
    project(column, lanes, neighbours_of(column, step));
    note_missing(column, lanes);
    trace(column, lanes);
  }
  /// Returns true for a micro-image that is traced completely: every other one of the step, which
  /// is 1 or 2.
  static bool is_key(int lens, int step) { return ((lens >> (step - 1)) & 1) == 0; }
  /// Splits lanes into those to trace (`keys`) and those to make from other micro-images.
  void take_keys(int column, int step, Lanes& lanes, Lanes& keys) const {
    const Column& c = columns_[static_cast<size_t>(column)];
    for (size_t r = 0; r < kPacket; ++r) {
      keys[r] = is_key(c.lens[r], step) ? lanes[r] : 0;
      lanes[r] &= ~keys[r];
    }
  }
  void project(int column, const Lanes& lanes, const Sides& sides) {
    Found found, other;
    search(plan_.kernel.on_chords, column, lanes, sides.left, found);
    search(plan_.kernel.on_chords, column, lanes, sides.right, other);
    plan_.kernel.merge(other, sides.part.data(), plan_.rules, found);
    plan_.kernel.put(found, lanes.data(), reprojection::kProjected,
                     columns_[static_cast<size_t>(column)]);
  }
  /// Searches the columns that contain the lenses with one of the kernel's functions.
  template <class Function>
  void search(Function function, int column, const Lanes& lanes, const Lanes& lenses,
              Found& found) const {
    const Range range = range_of(lenses, lanes, column);
    function(columns_.data(), range.first, range.end, lenses.data(),
             columns_[static_cast<size_t>(column)], plan_.rules, found);
  }
  void note_missing(int column, const Lanes& lanes) {
    Column& c = columns_[static_cast<size_t>(column)];
    for (size_t r = 0; r < kPacket; ++r)
      c.missing[r] |= c.flag[r] == reprojection::kEmpty ? lanes[r] : 0;
  }
  void mean(int column, const Lanes& lanes) {
    Column& c = columns_[static_cast<size_t>(column)];
    const Sides sides = neighbours_of(column, 1);
    Found one, other;
    search(plan_.kernel.same_place, column, lanes, sides.left, one);
    search(plan_.kernel.same_place, column, lanes, sides.right, other);
    reprojection::Rules both = plan_.rules;
    both.one_side = false;
    plan_.kernel.merge(other, sides.part.data(), both, one);
    for (size_t r = 0; r < kPacket; ++r)
      if (one.known[r] != 0) one.z[r] = std::numeric_limits<float>::quiet_NaN();
    plan_.kernel.put(one, lanes.data(), reprojection::kInterpolated, c);
  }
  /// Adds empty lanes to the queue, which is traced when it holds sixteen.
  void trace(int column, const Lanes& lanes) {
    const Column& c = columns_[static_cast<size_t>(column)];
    RayPacket& made = packets_.front();
    bool is_made = false;
    for (size_t r = 0; r < kPacket; ++r) {
      if (lanes[r] == 0 || c.flag[r] != reprojection::kEmpty) continue;
      if (!is_made) maker_.columns(column, {&made, 1});
      is_made = true;
      const size_t q = queue_.count++;
      const RTCRay16& from = made.rays.ray;
      set_lane(queue_.packet, q, {from.org_x[r], from.org_y[r], from.org_z[r]},
               {from.dir_x[r], from.dir_y[r], from.dir_z[r]});
      queue_.rays.panel_x[q] = c.panel_x[r];
      queue_.rays.tan[q] = c.tan[r];
      queue_.column[q] = column;
      queue_.lane[q] = r;
      const int row = static_cast<int>(r);
      const int subpixel = plan_.tiles.subpixel(tile_, column, row);
      queue_.channel[q] = (subpixel % kChannels + kChannels) % kChannels;
      queue_.seed[q] = sampling::subpixel_seed(tile_.row_begin + row, subpixel, 0);
      if (queue_.count == kPacket) flush();
    }
  }
  void flush() {
    if (queue_.count == 0) return;
    RayPacket& packet = queue_.packet;
    alignas(64) Lanes lanes;
    for (size_t q = 0; q < kPacket; ++q) {
      lanes[q] = packet.valid[q] = q < queue_.count ? -1 : 0;
      packet.rays.hit.geomID[q] = RTC_INVALID_GEOMETRY_ID;
    }

    alignas(64) std::array<float, kPacket> light;
    tracer_.set_seeds(queue_.seed);
    tracer_.trace_lanes(*scene_, plan_.tiles, queue_.channel, packet, light);
    plan_.kernel.take_hits(panel_, &packet.rays.ray.org_x[0], lanes.data(), queue_.rays);
    for (size_t q = 0; q < queue_.count; ++q) take(q, light[q]);
    queue_.count = 0;
  }
  void take(size_t queued, float light) {
    Column& c = columns_[static_cast<size_t>(queue_.column[queued])];
    const size_t r = queue_.lane[queued];
    const RTCHit16& hit = queue_.packet.rays.hit;
    c.flag[r] = reprojection::kTraced;
    c.x[r] = queue_.rays.x[queued];
    c.z[r] = queue_.rays.z[queued];
    c.code[r] = code_of(light, scene_->colour_managed);
    c.surface[r] = surface_of(hit.geomID[queued], hit.primID[queued]);
  }
  /// Returns a number that differs between neighbours that do not belong together.
  [[nodiscard]] int32_t surface_of(uint32_t geometry, uint32_t primitive) const {
    if (geometry == RTC_INVALID_GEOMETRY_ID) return reprojection::kSky;
    const uint32_t own =
        scene_->geometries[geometry].kind == GeometryEntry::Kind::Mesh ? 0 : primitive + 1;
    // A surface's number fits in a byte. Two surfaces that touch may share one, which is harmless,
    // because the lines between their points are too steep to be used.
    constexpr uint32_t kNumbers = 254;
    const uint32_t mixed = (geometry * 0x9E3779B1U) ^ (own * 0x85EBCA77U);
    return static_cast<int32_t>((mixed >> 8) % kNumbers);
  }
  void join(int column) {
    if (column < kChannels) return;
    plan_.kernel.join(columns_[static_cast<size_t>(column - kChannels)], plan_.rules,
                      columns_[static_cast<size_t>(column)]);
  }
  void join_all() {
    for (int column = 0; column < tile_.columns; ++column) join(column);
  }

  const SweepPlan& plan_;
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
