// SPDX-License-Identifier: Apache-2.0
#include "render/methods/method_full.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "frames/linear_codes.h"
#include "render/accel/denormals.h"
#include "render/depth_budget/prefilter.h"
#include "render/integrator/pbr_tracer.h"
#include "render/options/render_options.h"
#include "render/scene/texture.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {

bool LastFrame::shows(const Scene& scene) const {
  return known_ && picture_ == scene.picture &&
         std::ranges::equal(textures_, scene.textures, same_texture) &&
         same_texture(environment_, scene.backdrop.environment);
}

void LastFrame::keep(const Scene& scene, const frames::WovenFrame& frame,
                     const FrameErrors& errors) {
  frame_ = frame;
  errors_ = errors;
  picture_ = scene.picture;
  textures_ = scene.textures;
  environment_ = scene.backdrop.environment;
  known_ = true;
}

RenderStatistics LastFrame::copy_to(frames::WovenFrame& frame) const {
  const auto start = std::chrono::steady_clock::now();
  frame = frame_;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  RenderStatistics statistics;
  static_cast<FrameErrors&>(statistics) = errors_;
  statistics.subpixels = statistics.copied_subpixels = frame.bytes().size();
  statistics.seconds = elapsed.count();
  return statistics;
}

namespace {

/// Disables weak-ray skipping if rays are summed: the test is valid for one ray per subpixel only.
RenderOptions with_rays_that_add_up(RenderOptions options) {
  if (options.prefilter == Prefilter::Exhaustive) options.skip_weak_rays = false;
  return options;
}

std::vector<SubpixelPlace> places(const RenderOptions& options) {
  return options.prefilter == Prefilter::Exhaustive ? beam_samples(options.prefilter_samples)
                                                    : footprint_samples(options.samples);
}

}  // namespace

FullTiles::FullTiles(const optics::OpticalModel& model, const RenderOptions& options)
    : options_(with_rays_that_add_up(options)),
      plan_(model.rig()),
      packets_(model, plan_, options.isa),
      kernel_(shading_kernel_for(options.isa)) {
  for (const SubpixelPlace place : places(options)) samples_.emplace_back(model, place);
  if (options.prefilter == Prefilter::Depth || options.prefilter == Prefilter::Beam)
    prefilter_.emplace(model, plan_, options);
}

FullTiles::Worker::Worker(const FullTiles& tiles, const Scene& scene, const BeamTester& beams)
    : tiles_(tiles), scene_(scene), beams_(beams), maker_(tiles.packets_), tracer_(tiles.options_) {
  if (tiles.prefilter_) prefilter_.emplace(*tiles.prefilter_, scene);
}

FrameCounts FullTiles::Worker::counts() const {
  FrameCounts counts = tracer_.counts();
  if (prefilter_) counts += prefilter_->counts();
  counts.invalid_rays += refused_;
  counts.primary_rays += background_.filled();
  counts.primary_rays_culled += background_.filled();
  return counts;
}

void FullTiles::Worker::render(const Tile& tile, frames::WovenFrame& frame) {
  const FlushDenormals flush;
  WorkClock& clock = tracer_.clock();
  clock.turn_to(Work::MakeRays);
  light_.assign(static_cast<size_t>(tile.columns) * TilePlan::kRows, 0.0F);
  const double weight = 1.0 / static_cast<double>(tiles_.samples_.size());
  DepthRecorder* depths = prefilter_ ? &prefilter_->start(tile) : nullptr;
  for (size_t k = 0; k < tiles_.samples_.size(); ++k) {
    maker_.start(scene_, tile, tiles_.samples_[k]);
    trace(tile, {.number = static_cast<int>(k), .weight = weight, .depths = depths});
    refused_ += maker_.refused();  // found while packets are made
  }
  if (prefilter_) prefilter_->average(tile, maker_, light_);
  clock.turn_to(Work::Write);
  write(tile, frame);
  clock.turn_to(Work::Idle);
}

void FullTiles::Worker::trace(const Tile& tile, PacketTracer::FootprintSample sample) {
  const auto trace_columns = [&](ColumnRange columns) {
    tracer_.trace(scene_, tiles_.plan_, tile, columns, sample, maker_, light_);
  };
  if (!tiles_.options_.skip_background) return trace_columns({0, tile.columns});
  for (const Background::Run& run : background_.runs(beams_, maker_)) {
    if (!run.empty)
      trace_columns(run.columns);
    else
      background_.fill(scene_, tiles_.plan_, tile, run.columns, sample.weight, maker_, light_);
  }
}

void FullTiles::Worker::write(const Tile& tile, frames::WovenFrame& frame) const {
  const shading_kernel::Kernel& kernel = tiles_.kernel_;
  for (int row = 0; row < tile.rows; ++row) {
    // Subpixel 3 i + channel is byte 3 i + channel of the row.
    const int first = tiles_.plan_.subpixel(tile, 0, row);
    const int begin = std::max(0, -first);
    const int end = std::min(tile.columns, tiles_.plan_.row_subpixels() - first);
    const float* in = light_.data() + static_cast<size_t>(row) * tile.columns;
    if (begin >= end) continue;
    uint8_t* codes = frame.row(tile.row_begin + row);
    if (scene_.colour_managed)
      kernel.encode_linear(frames::linear_codes(), in + begin, end - begin, codes + first + begin);
    else
      kernel.encode(in + begin, end - begin, codes + first + begin);
  }
}

namespace {

/// Returns the shares of the work kinds. Idle time of present workers is not counted.
std::array<double, kWorks> shares(std::array<uint64_t, kWorks> ticks) {
  ticks[static_cast<size_t>(Work::Idle)] = 0;
  const auto sum = static_cast<double>(std::accumulate(ticks.begin(), ticks.end(), uint64_t{0}));
  std::array<double, kWorks> parts{};
  if (sum > 0.0)
    for (size_t w = 0; w < kWorks; ++w) parts[w] = static_cast<double>(ticks[w]) / sum;
  return parts;
}

class FullMethod final : public Method {
 public:
  FullMethod(std::shared_ptr<const FullTiles> tiles, const optics::Panel& panel,
             const RenderOptions& options)
      : options_(options),
        tiles_(std::move(tiles)),
        width_(panel.width_px),
        height_(panel.height_px),
        arena_(arena_threads(options.threads)) {}

  RenderStatistics render(const Scene& scene, const Stage&, frames::WovenFrame& frame) override {
    const frames::FrameGeometry& geometry = frame.geometry();
    LENTICULE_CHECK(geometry.width == width_ && geometry.height == height_ &&
                    geometry.format == frames::PixelFormat::Rgb8);
    require_supported(scene, options_);
    if (options_.copy_unchanged && last_.shows(scene)) return last_.copy_to(frame);
    const auto start = std::chrono::steady_clock::now();
    std::atomic<bool> cancelled{false};
    const BeamTester beams(scene);
    Workers workers([&] { return std::make_unique<FullTiles::Worker>(*tiles_, scene, beams); });
    const TilePlan& plan = tiles_->plan();
    arena_.execute([&] {
      tbb::parallel_for(0, plan.count(), [&](int number) {
        if (cancelled.load(std::memory_order_relaxed)) return;
        if (options_.cancelled && options_.cancelled()) {
          cancelled.store(true, std::memory_order_relaxed);
          return;
        }
        const int index = options_.tiles_backwards ? plan.count() - 1 - number : number;
        workers.local()->render(plan.tile(index), frame);
      });
    });
    if (options_.copy_unchanged && !cancelled.load()) last_.keep(scene, frame, {});
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    RenderStatistics statistics = statistics_of(workers);
    statistics.completed = !cancelled.load();
    statistics.subpixels = frame.bytes().size();
    statistics.traced_subpixels = statistics.subpixels;
    statistics.lights_left_out = scene.lights_left_out;
    statistics.seconds = elapsed.count();
    return statistics;
  }

 private:
  using Workers = tbb::enumerable_thread_specific<std::unique_ptr<FullTiles::Worker>>;

  static RenderStatistics statistics_of(Workers& workers) {
    RenderStatistics statistics;
    std::array<uint64_t, kWorks> ticks{};
    for (const std::unique_ptr<FullTiles::Worker>& worker : workers) {
      statistics += worker->counts();
      for (size_t w = 0; w < kWorks; ++w) ticks[w] += worker->ticks()[w];
    }
    statistics.work = shares(ticks);
    return statistics;
  }

  RenderOptions options_;
  std::shared_ptr<const FullTiles> tiles_;
  int width_;
  int height_;
  LastFrame last_;
  tbb::task_arena arena_;
};

}  // namespace

std::unique_ptr<Method> make_method_full(const optics::OpticalModel& model,
                                         const RenderOptions& options) {
  return make_method_full(std::make_shared<const FullTiles>(model, options), model.rig(), options);
}

std::unique_ptr<Method> make_method_full(std::shared_ptr<const FullTiles> tiles,
                                         const optics::Rig& rig, const RenderOptions& options) {
  return std::make_unique<FullMethod>(std::move(tiles), rig.panel, options);
}

}  // namespace lenticule::render
