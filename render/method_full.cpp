// SPDX-License-Identifier: Apache-2.0
#include "render/method_full.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/denormals.h"
#include "render/depth_budget/depth_prefilter.h"
#include "render/packet_tracer.h"
#include "render/primary_packets.h"
#include "render/skips/background.h"
#include "render/skips/last_frame.h"

namespace lenticule::render {
namespace {

void write_straight(const float* light, int count, uint8_t* codes) {
  for (int i = 0; i < count; ++i) codes[i] = frames::code_from_encoded(light[i]);
}
void write_managed(const float* light, int count, uint8_t* codes) {
  for (int i = 0; i < count; ++i) codes[i] = frames::code_from_linear(double{light[i]});
}

/// Idle time is what a worker that was there did not use; it is not counted.
std::array<double, kWorks> shares(std::array<uint64_t, kWorks> ticks) {
  ticks[static_cast<size_t>(Work::Idle)] = 0;
  const auto sum = static_cast<double>(std::accumulate(ticks.begin(), ticks.end(), uint64_t{0}));
  std::array<double, kWorks> parts{};
  if (sum > 0.0)
    for (size_t w = 0; w < kWorks; ++w) parts[w] = static_cast<double>(ticks[w]) / sum;
  return parts;
}

/// What a weak ray changes is known of one ray a subpixel, not of a sum.
RenderOptions with_rays_that_add_up(RenderOptions options) {
  if (options.prefilter == Prefilter::Exhaustive) options.skip_weak_rays = false;
  return options;
}

class FullMethod final : public Method {
 public:
  FullMethod(const optics::OpticalModel& model, const RenderOptions& options)
      : options_(with_rays_that_add_up(options)),
        plan_(model.rig()),
        packets_(model, plan_, options.isa),
        width_(model.rig().panel.width_px),
        height_(model.rig().panel.height_px),
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic) {
    for (const SubpixelPlace place : places(options)) samples_.emplace_back(model, place);
    if (options.prefilter == Prefilter::Depth || options.prefilter == Prefilter::Beam)
      prefilter_.emplace(model, plan_, options);
  }

  RenderStatistics render(const Scene& scene, const Stage&, frames::WovenFrame& frame) override {
    const frames::FrameGeometry& geometry = frame.geometry();
    LENTICULE_CHECK(geometry.width == width_ && geometry.height == height_ &&
                    geometry.format == frames::PixelFormat::Rgb8);
    if (options_.copy_unchanged && last_.shows(scene.impl())) return last_.copy_to(frame);
    const auto start = std::chrono::steady_clock::now();
    std::atomic<bool> cancelled{false};
    const BeamTester beams(scene.impl());
    tbb::enumerable_thread_specific<Worker> workers(
        [&] { return Worker(packets_, options_, prefilter_, scene.impl()); });
    arena_.execute([&] {
      tbb::parallel_for(0, plan_.count(), [&](int number) {
        if (cancelled.load(std::memory_order_relaxed)) return;
        if (options_.cancelled && options_.cancelled()) {
          cancelled.store(true, std::memory_order_relaxed);
          return;
        }
        const int index = options_.tiles_backwards ? plan_.count() - 1 - number : number;
        render_tile(scene.impl(), beams, plan_.tile(index), workers.local(), frame);
      });
    });
    if (options_.copy_unchanged && !cancelled.load()) last_.keep(scene.impl(), frame);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;

    RayCounts counts;
    PrefilterCounts prefiltered;
    std::array<uint64_t, kWorks> ticks{};
    for (Worker& worker : workers) {
      counts += worker.tracer.counts();
      if (worker.prefilter) {
        counts += worker.prefilter->rays();
        prefiltered += worker.prefilter->counts();
      }
      for (size_t w = 0; w < kWorks; ++w) ticks[w] += worker.tracer.clock().ticks()[w];
    }
    RenderStatistics statistics{.completed = !cancelled.load(),
                                .subpixels = frame.bytes().size(),
                                .lights_left_out = scene.impl().lights_left_out,
                                .traced_subpixels = frame.bytes().size(),
                                .seconds = elapsed.count(),
                                .work = shares(ticks)};
    counts.report(statistics);
    for (Worker& worker : workers) {
      statistics.invalid_rays += worker.refused;
      statistics.primary_rays += worker.background.filled();
      statistics.primary_rays_proved += worker.background.filled();
    }
    report(prefiltered, statistics);
    return statistics;
  }

 private:
  struct Worker {
    Worker(const PrimaryPackets& packets, const RenderOptions& options,
           const std::optional<DepthPrefilter>& depth, const Scene::Impl& scene)
        : maker(packets), tracer(options) {
      if (depth) prefilter.emplace(*depth, scene);
    }
    PrimaryPackets::Maker maker;
    Background background;
    uint64_t refused = 0;
    std::vector<float> light;
    PacketTracer tracer;
    std::optional<DepthPrefilter::Worker> prefilter;
  };

  static std::vector<SubpixelPlace> places(const RenderOptions& options) {
    return options.prefilter == Prefilter::Exhaustive ? beam_samples(options.prefilter_samples)
                                                      : footprint_samples(options.samples);
  }

  static void report(const PrefilterCounts& counts, RenderStatistics& statistics) {
    statistics.prefiltered_subpixels = counts.averaged;
    statistics.prefilter_rays = counts.rays;
    statistics.prefilter_rays_left_out = counts.rays_left_out;
  }

  void render_tile(const Scene::Impl& scene, const BeamTester& beams, const Tile& tile,
                   Worker& worker, frames::WovenFrame& frame) const {
    const FlushDenormals flush;
    WorkClock& clock = worker.tracer.clock();
    clock.turn_to(Work::MakeRays);
    worker.light.assign(static_cast<size_t>(tile.columns) * TilePlan::kRows, 0.0F);
    const double weight = 1.0 / static_cast<double>(samples_.size());
    DepthNotes* depths = worker.prefilter ? &worker.prefilter->start(tile) : nullptr;
    for (size_t k = 0; k < samples_.size(); ++k) {
      worker.maker.start(scene, tile, samples_[k]);
      trace_tile(scene, beams, tile,
                 {.number = static_cast<int>(k), .weight = weight, .depths = depths}, worker);
      worker.refused += worker.maker.refused();  // they are found out as packets are made
    }
    if (worker.prefilter) worker.prefilter->average(tile, worker.maker, worker.light);
    clock.turn_to(Work::Write);
    write_tile(scene, tile, worker.light, frame);
    clock.turn_to(Work::Idle);
  }

  void trace_tile(const Scene::Impl& scene, const BeamTester& beams, const Tile& tile,
                  PacketTracer::FootprintSample sample, Worker& worker) const {
    const auto trace = [&](ColumnRange columns) {
      worker.tracer.trace(scene, plan_, tile, columns, sample, worker.maker, worker.light);
    };
    if (!options_.skip_background) return trace({0, tile.columns});
    for (const Background::Run& run : worker.background.runs(beams, worker.maker)) {
      if (!run.empty)
        trace(run.columns);
      else
        worker.background.fill(scene, plan_, tile, run.columns, sample.weight, worker.maker,
                               worker.light);
    }
  }

  void write_tile(const Scene::Impl& scene, const Tile& tile, const std::vector<float>& light,
                  frames::WovenFrame& frame) const {
    const auto write = scene.colour_managed ? write_managed : write_straight;
    for (int row = 0; row < tile.rows; ++row) {
      // Subpixel 3 i + channel is byte 3 i + channel of the row.
      const int first = plan_.subpixel(tile, 0, row);
      const int begin = std::max(0, -first);
      const int end = std::min(tile.columns, plan_.row_subpixels() - first);
      const float* in = light.data() + static_cast<size_t>(row) * tile.columns;
      if (begin < end)
        write(in + begin, end - begin, frame.row(tile.row_begin + row) + first + begin);
    }
  }

  RenderOptions options_;
  TilePlan plan_;
  PrimaryPackets packets_;
  std::vector<Footprint> samples_;
  std::optional<DepthPrefilter> prefilter_;
  int width_;
  int height_;
  LastFrame last_;
  tbb::task_arena arena_;
};

}  // namespace

std::unique_ptr<Method> make_method_full(const optics::OpticalModel& model,
                                         const RenderOptions& options) {
  return std::make_unique<FullMethod>(model, options);
}

}  // namespace lenticule::render
