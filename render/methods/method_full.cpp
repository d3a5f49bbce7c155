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
#include "render/culling/last_frame.h"
#include "render/integrator/pbr_tracer.h"

namespace lenticule::render {
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
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic) {}

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
