// SPDX-License-Identifier: Apache-2.0
// The methods that reuse points: lens-view and interpolate within a frame (micro_image_sweep.h),
// temporal and hybrid over time, with the points of the previous frame (PointHistory).
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/error.h"
#include "optics/model.h"
#include "render/accel/denormals.h"
#include "render/integrator/pbr_tracer.h"
#include "render/methods/method.h"
#include "render/methods/reuse/micro_image_sweep.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/options/render_options.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

using reprojection::Column;

/// Every so many frames one is traced completely, counted from frame 0, so that a sequence has the
/// same traced frames no matter at which frame it is started.
constexpr uint64_t kKeyFrames = 16;
/// A picture that moves farther than this fraction of the panel's diagonal between two frames is
/// treated as a new picture.
constexpr double kCut = 1.0 / 16.0;

constexpr float kNoPoint = std::numeric_limits<float>::quiet_NaN();
constexpr uint64_t kNothing = ~uint64_t{0};
constexpr double kSteps = 127.0;

/// Maps a float to an integer with the same order, for both signs.
uint32_t ordered(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return (bits >> 31) != 0 ? ~bits : bits | 0x80000000U;
}
float from_ordered(uint32_t order) {
  return std::bit_cast<float>((order >> 31) != 0 ? order & 0x7FFFFFFFU : ~order);
}

int8_t stepped(double part) {
  return static_cast<int8_t>(std::lround(std::clamp(part, -1.0, 1.0) * kSteps));
}

/// PointHistory stores 24 bytes per subpixel of the panel. After begin(), a frame makes three
/// passes over all tiles: project(), take(), keep(). Each pass may run on any number of threads,
/// and must be complete before the next pass.
class PointHistory {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  PointHistory(const optics::OpticalModel& model, const TilePlan& plan)
      : model_(model), plan_(plan), lenses_(model, plan) {
    const optics::Rig& rig = model.rig();
    const int last_row = rig.panel.height_px - 1;
    for (int channel = 0; channel < 3; ++channel) {
      const optics::SubpixelRay top = model.ray(rig.panel.width_px / 2, 0, channel);
      const optics::SubpixelRay bottom = model.ray(rig.panel.width_px / 2, last_row, channel);
      const double rows = std::max(last_row, 1);
      planes_[static_cast<size_t>(channel)] = {
          .lens_y = top.lens_y_mm,
          .lens_y_step = last_row > 0 ? (bottom.lens_y_mm - top.lens_y_mm) / rows : -1.0,
          .tan_y = top.tan_y,
          .tan_y_step = (bottom.tan_y - top.tan_y) / rows};
    }
    const double gap_mm = rig.sheet.gap.value;
    slot_tan_ = gap_mm > 0.0 ? rig.panel.pixel_width.value / gap_mm : 0.0;
    slant_step_ = static_cast<int>(std::lround(3.0 * rig.sheet.slant));
    const size_t subpixels =
        static_cast<size_t>(plan.row_subpixels()) * static_cast<size_t>(rig.panel.height_px);
    last_.resize(subpixels);
    next_.resize(subpixels, Point{.z = kNoPoint});
    arrived_ = std::make_unique<std::atomic<uint64_t>[]>(subpixels);
  }

  /// Begins a frame. `next_from_last` is the motion of the scene on the panel since the previous
  /// frame.
  void begin(const Affine& next_from_last) {
    next_from_last_ = next_from_last;
    const auto is_near = [](const Vec3& a, const Vec3& b) { return length(a - b) < 1e-9; };
    const Affine same;
    still_ = is_near(next_from_last.column_x, same.column_x) &&
             is_near(next_from_last.column_y, same.column_y) &&
             is_near(next_from_last.column_z, same.column_z) &&
             is_near(next_from_last.origin, same.origin);
    std::swap(last_, next_);
    for (size_t i = 0; i < last_.size(); ++i)
      arrived_[i].store(kNothing, std::memory_order_relaxed);
  }

  /// Re-projects this tile's points of the previous frame. A point goes to the subpixel, among
  /// those that could show the point, nearest to the point's previous view. `columns` hold the
  /// tile's rays.
  void project(const Tile& tile, std::span<const Column> columns) {
    for (int lane = 0; lane < tile.rows; ++lane)
      for (int c = 0; c < tile.columns; ++c) {
        const Column& column = columns[static_cast<size_t>(c)];
        if (column.flag[lane] != reprojection::kOutside)
          project_point(tile.row_begin + lane, plan_.subpixel(tile, c, lane), column.panel_x[lane],
                        column.tan[lane]);
      }
  }

  /// Fills the empty subpixels of a tile with the points that have arrived. If several points
  /// arrived at a subpixel, the one nearest to the eye is taken. While the scene moves, a point is
  /// rejected if it lies behind the points beside it, or at the panel's border: it may be visible
  /// through a gap, or be occluded by new content. A point that lies beside its subpixel's ray or
  /// row has the colour of another place: it is rejected if the codes beside it, in its channel,
  /// differ from it by more than kAgreement.
  void take(const Tile& tile, std::span<Column> columns) const {
    for (int lane = 0; lane < tile.rows; ++lane)
      for (int c = 0; c < tile.columns; ++c) {
        Column& column = columns[static_cast<size_t>(c)];
        if (column.flag[lane] != reprojection::kEmpty) continue;
        const int row = tile.row_begin + lane;
        const int subpixel = plan_.subpixel(tile, c, lane);
        const uint64_t arrival = arrived_[index(row, subpixel)].load(std::memory_order_relaxed);
        if (arrival == kNothing) continue;
        const Point& point = last_[static_cast<size_t>(arrival & 0xFFFFFFFFU)];
        const double far = reach(double{point.z});
        const double across = point.across / kSteps * far;
        // Near its border, a lens ends elsewhere than the numbers of the lenses say.
        if (std::abs(across) > 0.9 * far) continue;
        if (!still_ && (may_be_hidden(row, subpixel, point.z) || !agrees(row, subpixel, point)))
          continue;
        column.flag[lane] = reprojection::kProjected;
        column.z[lane] = point.z;
        column.x[lane] =
            column.panel_x[lane] + column.tan[lane] * point.z + static_cast<float>(across);
        column.down[lane] = static_cast<float>(point.down / kSteps);
        column.code[lane] = static_cast<float>(point.code);
        column.surface[lane] = point.surface == 255 ? reprojection::kSky : point.surface;
      }
  }

  /// Stores the points of a finished tile.
  void keep(const Tile& tile, std::span<const Column> columns) {
    for (int lane = 0; lane < tile.rows; ++lane)
      for (int c = 0; c < tile.columns; ++c) {
        const int subpixel = plan_.subpixel(tile, c, lane);
        if (subpixel < 0 || subpixel >= plan_.row_subpixels()) continue;
        const Column& column = columns[static_cast<size_t>(c)];
        const float z = column.z[lane];
        const double beside = double{column.x[lane]} -
                              (double{column.panel_x[lane]} + double{column.tan[lane]} * double{z});
        Point& point = next_[index(tile.row_begin + lane, subpixel)];
        point = {.z = kNoPoint};
        if (!(z == z)) continue;
        point = {.z = z,
                 .across = stepped(beside / reach(double{z})),
                 .down = stepped(double{column.down[lane]}),
                 .code = static_cast<uint8_t>(column.code[lane] + 0.5F),
                 .surface = static_cast<uint8_t>(column.surface[lane] & 0xFF)};
      }
  }

 private:
  struct Point {
    float z = 0.0F;     ///< panel millimetres; NaN if there is no point
    int8_t across = 0;  ///< offset from the subpixel's ray, in 1/127 of reach()
    int8_t down = 0;    ///< offset from the subpixel's row, in 1/127 row
    uint8_t code = 0;
    uint8_t surface = 0;
  };
  /// lens_y and tan_y of the rows of one channel.
  struct RowPlanes {
    double lens_y = 0.0, lens_y_step = 0.0;
    double tan_y = 0.0, tan_y_step = 0.0;
  };
  /// Place is the place of a point on the next frame: the subpixel (row -1 for none) and the offset
  /// from it.
  struct Place {
    int row = -1;
    int subpixel = 0;
    double across_mm = 0.0;
    double down = 0.0;
  };
  [[nodiscard]] size_t index(int row, int subpixel) const {
    return static_cast<size_t>(row) * static_cast<size_t>(plan_.row_subpixels()) +
           static_cast<size_t>(subpixel);
  }

  void project_point(int row, int subpixel, float panel_x, float tan) {
    const size_t source = index(row, subpixel);
    Point& point = last_[source];
    if (!(point.z == point.z)) return;
    const int channel = subpixel % 3;
    const RowPlanes& plane = planes_[static_cast<size_t>(channel)];
    const double z = double{point.z};
    const double at = row + point.down / kSteps;
    const double lens_y = plane.lens_y + at * plane.lens_y_step;
    const double tan_y = plane.tan_y + at * plane.tan_y_step;
    const Vec3 moved =
        next_from_last_.point({double{panel_x} + double{tan} * z + point.across / kSteps * reach(z),
                               lens_y + tan_y * z, z});
    const Place to = place(moved, double{panel_x}, double{tan}, channel);
    point.z = kNoPoint;
    if (to.row < 0) return;
    point.z = static_cast<float>(moved.z);
    point.across = stepped(to.across_mm / reach(moved.z));
    point.down = stepped(to.down);
    const uint64_t arrival = uint64_t{ordered(-point.z)} << 32 | static_cast<uint64_t>(source);
    std::atomic<uint64_t>& slot = arrived_[index(to.row, to.subpixel)];
    uint64_t there = slot.load(std::memory_order_relaxed);
    while (arrival < there &&
           !slot.compare_exchange_weak(there, arrival, std::memory_order_relaxed)) {
    }
  }

  [[nodiscard]] Place place(const Vec3& point, double panel_x, double tan, int channel) const {
    const optics::Rig& rig = model_.rig();
    const double distance = rig.viewing.distance.value;
    if (!is_finite(point) || !(point.z < kNearestContent * distance)) return {};
    const RowPlanes& plane = planes_[static_cast<size_t>(channel)];
    const double row_at = (point.y - plane.lens_y - point.z * plane.tan_y) /
                          (plane.lens_y_step + point.z * plane.tan_y_step);
    if (!(row_at > -0.5) || !(row_at < rig.panel.height_px - 0.5)) return {};
    const int row = static_cast<int>(std::lround(row_at));

    // Among all rays through the point, takes the one nearest to the point's previous view,
    // measured in lenses and in slots: near the panel this is the same direction, far from it the
    // same lens.
    const double pitch = model_.pitch_mm();
    const double slot = point.z * slot_tan_;
    const double off = (point.x - panel_x - point.z * tan) / (pitch * pitch + slot * slot);
    const double tan_x = tan + off * slot * slot_tan_;
    const double near_x = panel_x + off * pitch * pitch;
    const LensNumbers::Line lens = lenses_.line_at(row, channel, near_x);
    const double number = std::round(lens.offset + lens.per_mm * near_x);
    const double lens_x = (number - lens.offset) / lens.per_mm;

    // Panel point from which this ray comes, by the shift due to refraction.
    const double tan_y = plane.tan_y + row * plane.tan_y_step;
    const double bend = 1.0 - rig.sheet.refraction_shape;
    const double square = 1.0 + bend * (tan_x * tan_x + tan_y * tan_y);
    const double x_px = rig.panel.x_px(lens_x - rig.sheet.gap.value * tan_x / std::sqrt(square));
    const int cell = std::clamp(static_cast<int>(std::floor(x_px)), 0, rig.panel.width_px - 1);
    const double ideal = x_px - rig.panel.layout.offset(cell, row, channel).x_px;
    if (!(ideal > -0.5) || !(ideal < rig.panel.width_px - 0.5)) return {};
    const int pixel = static_cast<int>(std::lround(ideal));
    const double shift_per_tan =
        rig.sheet.gap.value * (1.0 + bend * tan_y * tan_y) / (square * std::sqrt(square));
    const double slot_turn =
        shift_per_tan > 0.0 ? (ideal - pixel) * rig.panel.pixel_width.value / shift_per_tan : 0.0;
    return {.row = row,
            .subpixel = 3 * pixel + channel,
            .across_mm = point.x - lens_x - (tan_x + slot_turn) * point.z,
            .down = row_at - row};
  }

  /// Returns the largest distance of a point from its ray, in millimetres.
  [[nodiscard]] double reach(double z) const { return model_.pitch_mm() + std::abs(z) * slot_tan_; }

  /// Returns the depth of the point that arrived at a subpixel; -infinity for none, NaN outside the
  /// panel.
  [[nodiscard]] float depth(int row, int subpixel) const {
    if (row < 0 || row >= model_.rig().panel.height_px || subpixel < 0 ||
        subpixel >= plan_.row_subpixels())
      return kNoPoint;
    const uint64_t arrival = arrived_[index(row, subpixel)].load(std::memory_order_relaxed);
    return arrival == kNothing ? -std::numeric_limits<float>::infinity()
                               : -from_ordered(static_cast<uint32_t>(arrival >> 32));
  }

  [[nodiscard]] bool agrees(int row, int subpixel, const Point& point) const {
    const auto differs = [&](int other_row, int other, int8_t off) {
      const float z = depth(other_row, other);
      if (!std::isfinite(z)) return false;
      const uint64_t arrival = arrived_[index(other_row, other)].load(std::memory_order_relaxed);
      const int beside = last_[static_cast<size_t>(arrival & 0xFFFFFFFFU)].code;
      const double steps = std::min(1.0, 2.0 * std::abs(off) / kSteps);
      return steps * std::abs(beside - point.code) > double{kAgreement};
    };
    // Neighbours of the same channel, nearest to the lens's slant.
    const int left = 3 * static_cast<int>(std::lround(slant_step_ / 3.0));
    return !differs(row, subpixel - 3, point.across) && !differs(row, subpixel + 3, point.across) &&
           !differs(row - 1, subpixel + left, point.down) &&
           !differs(row + 1, subpixel - left, point.down);
  }

  /// Returns true if a nearer point, or the panel's border, lies beside the place, so that new
  /// content may occlude the point. Outlines move by fractions of a subpixel, and traced points
  /// start at subpixel centres, so the occluding points would never arrive at the place themselves.
  [[nodiscard]] bool may_be_hidden(int row, int subpixel, float z) const {
    const auto margin = static_cast<float>(reach(double{z}));
    const auto hides = [&](int other_row, int other) {
      const float nearest = depth(other_row, other);
      return std::isnan(nearest) || nearest > z + margin;
    };
    return hides(row, subpixel - 3) || hides(row, subpixel + 3) ||
           hides(row - 1, subpixel + slant_step_) || hides(row + 1, subpixel - slant_step_);
  }

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  LensNumbers lenses_;
  std::array<RowPlanes, 3> planes_;
  double slot_tan_ = 0.0;
  int slant_step_ = 0;  ///< subpixels to the left from one row to the next
  Affine next_from_last_;
  bool still_ = false;  ///< the scene does not move: every point keeps its place
  std::vector<Point> last_, next_;
  /// Per subpixel the minimum of all arrived keys: a depth in the upper half (nearer is less) and
  /// the point's index in the lower half, so that the result does not depend on the order of
  /// arrival.
  std::unique_ptr<std::atomic<uint64_t>[]> arrived_;
};

/// Counts the subpixels of a tile by the origin of their colour.
FrameCounts count_flags(std::span<const Column> columns) {
  FrameCounts counts;
  for (const Column& column : columns)
    for (size_t r = 0; r < kPacket; ++r) {
      counts.projected_subpixels += column.flag[r] == reprojection::kProjected ? 1 : 0;
      counts.interpolated_subpixels += column.flag[r] == reprojection::kInterpolated ? 1 : 0;
      counts.missing_subpixels += column.missing[r] != 0 ? 1 : 0;
    }
  return counts;
}

/// Returns true if the picture moves so far between two stages that it counts as a new picture.
/// Tested at the panel's corners, on the panel and half the panel's height in front of and behind
/// it.
bool is_cut(const Affine& next_from_last, const optics::Panel& panel) {
  const double width = panel.width_px * panel.pixel_width.value;
  const double height = panel.height_px * panel.pixel_height.value;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      for (const double z : {-0.5, 0.0, 0.5}) {
        const Vec3 corner{x * width, y * height, z * height};
        const double moves = length(next_from_last.point(corner) - corner);
        // NaN counts as a cut.
        if (!(moves <= kCut * std::hypot(width, height))) return true;
      }
  return false;
}

class ReuseMethod final : public Method {
 public:
  ReuseMethod(Reuse reuse, const optics::OpticalModel& model, const RenderOptions& options)
      : reuse_(reuse),
        model_(model),
        options_(options),
        plan_(model, options),
        geometry_{model.rig().panel.width_px, model.rig().panel.height_px,
                  frames::PixelFormat::Rgb8},
        arena_(arena_threads(options.threads)) {
    if (options.keep_missing) missing_ = frames::WovenFrame(geometry_);
  }

  void set_frame(uint64_t number) override { number_ = number; }

  uint64_t first_needed(uint64_t number) const override {
    const bool continues = last_ && last_->number + 1 == number;
    return !over_time() || continues ? number : number - number % kKeyFrames;
  }

  RenderStatistics render(const Scene& scene, const Stage& stage,
                          frames::WovenFrame& frame) override {
    LENTICULE_CHECK(frame.geometry() == geometry_);
    require_supported(scene, options_);
    const auto start = std::chrono::steady_clock::now();
    Workers workers([this] { return Worker(plan_, options_); });
    const bool follows = over_time() && start_history(scene, stage);
    const bool completed = (!follows || for_tiles(workers,
                                                  [&](const Tile& tile, MicroImageSweep& sweep) {
                                                    sweep.start(scene, tile);
                                                    history_->project(tile, sweep.columns());
                                                  })) &&
                           for_tiles(workers, [&](const Tile& tile, MicroImageSweep& sweep) {
                             sweep.start(scene, tile);
                             fill(tile, sweep, follows);
                             workers.local().counts += count_flags(sweep.columns());
                             if (over_time()) history_->keep(tile, sweep.columns());
                             write_tile(tile, sweep.columns(), frame);
                           });
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    RenderStatistics statistics = gather(workers);
    statistics.completed = completed;
    statistics.seconds = elapsed.count();
    last_.reset();
    if (completed) last_ = {number_, scene.content, scene.textures, stage.world_from_panel};
    ++number_;
    return statistics;
  }

  const frames::WovenFrame* missing_subpixels() const override {
    return options_.keep_missing ? &missing_ : nullptr;
  }

 private:
  struct Worker {
    Worker(const SweepPlan& plan, const RenderOptions& options) : sweep(plan, options) {}
    MicroImageSweep sweep;
    FrameCounts counts;  ///< see count_flags()
  };
  using Workers = tbb::enumerable_thread_specific<Worker>;

  [[nodiscard]] RenderStatistics gather(Workers& workers) const {
    RenderStatistics statistics;
    for (Worker& worker : workers) {
      statistics += worker.sweep.tracer().counts();
      statistics += worker.counts;
    }
    statistics.subpixels = geometry_.frame_bytes();
    statistics.traced_subpixels =
        statistics.subpixels - statistics.projected_subpixels - statistics.interpolated_subpixels;
    return statistics;
  }

  [[nodiscard]] bool over_time() const {
    return reuse_ == Reuse::Temporal || reuse_ == Reuse::Hybrid;
  }

  /// Returns true if the frame can be made from the previous one.
  bool start_history(const Scene& scene, const Stage& stage) {
    if (!history_) history_ = std::make_unique<PointHistory>(model_, plan_.tiles);
    if (!last_ || last_->number + 1 != number_ || number_ % kKeyFrames == 0 ||
        last_->content != scene.content ||
        !std::ranges::equal(last_->textures, scene.textures, same_texture))
      return false;
    const Affine next_from_last = stage.panel_from_world * last_->world_from_panel;
    if (is_cut(next_from_last, model_.rig().panel)) return false;
    history_->begin(next_from_last);
    return true;
  }

  void fill(const Tile& tile, MicroImageSweep& sweep, bool follows) {
    if (reuse_ == Reuse::LensView) return sweep.lens_view();
    if (reuse_ == Reuse::Interpolate) return sweep.interpolate();
    if (follows) {
      history_->take(tile, sweep.columns());
      if (reuse_ == Reuse::Hybrid) sweep.fill_from_neighbours();
      sweep.note_empty();
      if (number_ % 2 == 1) sweep.fill_with_means();
    }
    sweep.trace_empty();
  }

  /// Calls `act` for all tiles. Returns false if the render was cancelled.
  template <class Act>
  bool for_tiles(Workers& workers, const Act& act) {
    std::atomic<bool> cancelled{false};
    arena_.execute([&] {
      tbb::parallel_for(0, plan_.tiles.count(), [&](int index) {
        if (cancelled.load(std::memory_order_relaxed)) return;
        if (options_.cancelled && options_.cancelled()) {
          cancelled.store(true, std::memory_order_relaxed);
          return;
        }
        const FlushDenormals flush;
        act(plan_.tiles.tile(index), workers.local().sweep);
      });
    });
    return !cancelled.load();
  }

  void write_tile(const Tile& tile, std::span<const Column> columns, frames::WovenFrame& frame) {
    for (int row = 0; row < tile.rows; ++row) {
      const int first = plan_.tiles.subpixel(tile, 0, row);
      const int begin = std::max(0, -first);
      const int end = std::min(tile.columns, plan_.tiles.row_subpixels() - first);
      const Column* in = columns.data();
      uint8_t* out = frame.row(tile.row_begin + row) + first;
      for (int c = begin; c < end; ++c) out[c] = static_cast<uint8_t>(in[c].code[row] + 0.5F);
      if (!options_.keep_missing) continue;
      uint8_t* holes = missing_.row(tile.row_begin + row) + first;
      for (int c = begin; c < end; ++c) holes[c] = in[c].missing[row] != 0 ? 255 : 0;
    }
  }

  /// The frame in the history.
  struct Last {
    uint64_t number = 0;
    Fingerprint content;
    std::vector<std::shared_ptr<const Texture>> textures;
    Affine world_from_panel;
  };

  Reuse reuse_;
  const optics::OpticalModel& model_;
  RenderOptions options_;
  SweepPlan plan_;
  frames::FrameGeometry geometry_;
  frames::WovenFrame missing_;
  uint64_t number_ = 0;
  std::optional<Last> last_;
  std::unique_ptr<PointHistory> history_;
  tbb::task_arena arena_;
};

}  // namespace

std::optional<Reuse> reuse_named(std::string_view name) {
  if (name == "lens-view") return Reuse::LensView;
  if (name == "interpolate") return Reuse::Interpolate;
  if (name == "temporal") return Reuse::Temporal;
  if (name == "hybrid") return Reuse::Hybrid;
  return std::nullopt;
}

std::unique_ptr<Method> make_method_reuse(Reuse reuse, const optics::OpticalModel& model,
                                          const RenderOptions& options) {
  return std::make_unique<ReuseMethod>(reuse, model, options);
}

}  // namespace lenticule::render
