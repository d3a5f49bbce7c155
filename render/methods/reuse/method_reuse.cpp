// SPDX-License-Identifier: Apache-2.0
#include "render/methods/reuse/method_reuse.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "render/accel/denormals.h"
#include "render/integrator/pbr_tracer.h"
#include "render/methods/reuse/micro_image_sweep.h"
#include "render/methods/reuse/point_history.h"
#include "render/scene/scene.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

using reprojection::Column;

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
bool is_cut(const Affine& next_from_last, const optics::Panel& panel, double most) {
  const double width = panel.width_px * panel.pixel_width.value;
  const double height = panel.height_px * panel.pixel_height.value;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      for (const double z : {-0.5, 0.0, 0.5}) {
        const Vec3 corner{x * width, y * height, z * height};
        const double moves = length(next_from_last.point(corner) - corner);
        // NaN counts as a cut.
        if (!(moves <= most * std::hypot(width, height))) return true;
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
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic) {
    if (options.keep_missing) missing_ = frames::WovenFrame(geometry_);
  }

  void set_frame(uint64_t number) override { number_ = number; }

  uint64_t first_needed(uint64_t number) const override {
    const bool continues = last_ && last_->number + 1 == number;
    return !over_time() || continues ? number : number - number % key_frames();
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
  [[nodiscard]] uint64_t key_frames() const {
    return static_cast<uint64_t>(std::max(options_.reuse.key_frames, 1));
  }

  /// Returns true if the frame can be made from the previous one.
  bool start_history(const Scene& scene, const Stage& stage) {
    if (!history_) history_ = std::make_unique<PointHistory>(model_, plan_.tiles);
    if (!last_ || last_->number + 1 != number_ || number_ % key_frames() == 0 ||
        last_->content != scene.content ||
        !std::ranges::equal(last_->textures, scene.textures, same_texture))
      return false;
    const Affine next_from_last = stage.panel_from_world * last_->world_from_panel;
    if (is_cut(next_from_last, model_.rig().panel, options_.reuse.cut)) return false;
    history_->begin(next_from_last);
    return true;
  }

  void fill(const Tile& tile, MicroImageSweep& sweep, bool follows) {
    if (reuse_ == Reuse::LensView) return sweep.lens_view();
    if (reuse_ == Reuse::Interpolate) return sweep.interpolate();
    if (follows) {
      history_->take(tile, options_.reuse.agreement, sweep.columns());
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
