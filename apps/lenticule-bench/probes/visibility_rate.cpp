// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/probes/visibility_rate.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <chrono>
#include <span>

#include "render/accel/denormals.h"
#include "render/accel/ray_stream.h"
#include "render/rays/primary_packets.h"

namespace lenticule::bench {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

class VisibilityTimer {
 public:
  VisibilityTimer(const render::Scene& scene, const optics::OpticalModel& model, int threads)
      : scene_(scene),
        plan_(model.rig()),
        packets_(model, plan_),
        footprint_(model, {}),
        rays_(3 * static_cast<uint64_t>(model.rig().panel.width_px) *
              static_cast<uint64_t>(model.rig().panel.height_px)),
        arena_(threads > 0 ? threads : tbb::task_arena::automatic) {}

  VisibilityTiming run() {
    arena_.execute([&] {
      tbb::parallel_for(0, plan_.count(), [&](int index) {
        const render::FlushDenormals flush;
        time_tile(index, workers_.local());
      });
    });
    VisibilityTiming timing{.rays = rays_};
    for (const Worker& worker : workers_) {
      timing.bare_seconds += worker.bare_seconds;
      timing.pass_seconds += worker.pass_seconds;
    }
    timing.bare_seconds /= arena_.max_concurrency();
    timing.pass_seconds /= arena_.max_concurrency();
    return timing;
  }

 private:
  struct Worker {
    explicit Worker(const render::PrimaryPackets& rig) : maker(rig), packets(kManyPackets) {
      init_packets(packets);
    }
    render::PrimaryPackets::Maker maker;
    std::vector<render::RayPacket> packets;
    double bare_seconds = 0.0;
    double pass_seconds = 0.0;
  };

  void intersect(render::RayPacket& packet) {
    intersect16(packet.valid, scene_.embree.get(), packet.rays, render::Coherence::Coherent);
  }

  /// Runs both methods one after the other, so that other load on the machine affects both equally;
  /// every second tile in reverse order, because the second method finds the scene in the caches.
  void time_tile(int index, Worker& worker) {
    const render::Tile tile = plan_.tile(index);
    if (index % 2 == 0) trace_prepared(tile, worker);
    trace_whole(tile, worker);
    if (index % 2 != 0) trace_prepared(tile, worker);
  }

  void trace_prepared(const render::Tile& tile, Worker& worker) {
    worker.maker.start(scene_, tile, footprint_);
    worker.maker.prepare(worker.packets);
    for (int column = 0; column < tile.columns; column += kManyPackets) {
      worker.maker.columns(column, worker.packets);
      const Clock::time_point start = Clock::now();
      for (render::RayPacket& packet : worker.packets) intersect(packet);
      worker.bare_seconds += seconds_since(start);
    }
  }

  /// Processes a few packets at a time, so that they stay in the first-level cache.
  void trace_whole(const render::Tile& tile, Worker& worker) {
    const Clock::time_point start = Clock::now();
    worker.maker.start(scene_, tile, footprint_);
    const std::span<render::RayPacket> few = std::span(worker.packets).first(kFewPackets);
    worker.maker.prepare(few);
    for (int column = 0; column < tile.columns; column += kFewPackets) {
      worker.maker.columns(column, few);
      for (render::RayPacket& packet : few) intersect(packet);
    }
    worker.pass_seconds += seconds_since(start);
  }

  static constexpr int kFewPackets = 8;
  static constexpr int kManyPackets = 64;
  static_assert(render::TilePlan::kColumns % kFewPackets == 0 &&
                render::TilePlan::kColumns % kManyPackets == 0);

  const render::Scene& scene_;
  render::TilePlan plan_;
  render::PrimaryPackets packets_;
  render::Footprint footprint_;
  uint64_t rays_;
  tbb::task_arena arena_;
  tbb::enumerable_thread_specific<Worker> workers_{[this] { return Worker(packets_); }};
};

}  // namespace

VisibilityTiming time_visibility(const render::Scene& scene, const optics::OpticalModel& model,
                                 int threads) {
  return VisibilityTimer(scene, model, threads).run();
}

}  // namespace lenticule::bench
