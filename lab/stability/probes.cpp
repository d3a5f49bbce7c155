// SPDX-License-Identifier: Apache-2.0
#include "lab/stability/probes.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "render/accel/denormals.h"
#include "render/integrator/packet_tracer.h"
#include "render/options/render_options.h"
#include "render/shading/shading_tables.h"

namespace lenticule::lab {

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

/// The distance between the rows of a typical panel.
constexpr double kStepMm = 0.1;

render::PathRay path_ray(const ProbeRay& ray) {
  return {.origin = ray.origin, .direction = ray.direction, .target = 0};
}

Vec3 lane(const float (&lanes)[3][render::kPacket], size_t k) {
  return {double{lanes[0][k]}, double{lanes[1][k]}, double{lanes[2][k]}};
}

ProbeHit probe_hit(const render::RayPacket& packet,
                   const render::shading_kernel::Surfaces& surfaces, size_t k) {
  if (packet.valid[k] == 0) return {};
  if (surfaces.active[k] == 0) return {.what = ProbeHit::What::Nothing, .distance = kFar};
  return {.what = ProbeHit::What::Surface,
          .distance = double{packet.rays.ray.tfar[k]},
          .point = lane(surfaces.point, k),
          .geometric_normal = lane(surfaces.geometric, k),
          .outer_side = surfaces.outer_side[k] != 0,
          .spawn_point = lane(surfaces.start, k),
          .geometry = packet.rays.hit.geomID[k],
          .primitive = packet.rays.hit.primID[k]};
}

}  // namespace

uint64_t intersect(const render::EmbreeScene& scene, std::span<const render::PathRay> rays,
                   render::Coherence coherence, std::span<render::Hit> hits) {
  static_assert(render::Hit::kMiss == RTC_INVALID_GEOMETRY_ID);
  uint64_t refused = 0;
  render::RayPacket packet;
  for (size_t begin = 0; begin < rays.size(); begin += render::kPacket) {
    const auto lanes = rays.subspan(begin, std::min(render::kPacket, rays.size() - begin));
    refused += load_packet(lanes, packet);
    intersect16(packet.valid, scene, packet.rays, coherence);
    for (size_t i = 0; i < lanes.size(); ++i) {
      const bool traced = packet.valid[i] != 0;
      hits[begin + i] = {.geometry = traced ? packet.rays.hit.geomID[i] : render::Hit::kRefused,
                         .primitive = packet.rays.hit.primID[i],
                         .distance = packet.rays.ray.tfar[i]};
    }
  }
  return refused;
}

uint64_t add_unshadowed(const render::EmbreeScene& scene, std::span<const ShadowRay> rays,
                        std::span<double> light) {
  // Fraction of the distance to a light within which an occluder counts as the light itself.
  constexpr double kLightClearance = 1.0 / (1 << 18);
  uint64_t refused = 0;
  render::RayPacket packet;
  std::vector<render::PathRay> lanes;
  for (size_t begin = 0; begin < rays.size(); begin += render::kPacket) {
    const auto shadow = rays.subspan(begin, std::min(render::kPacket, rays.size() - begin));
    lanes.clear();
    for (const ShadowRay& ray : shadow)
      lanes.push_back({.origin = ray.origin, .direction = ray.direction, .target = 0});
    refused += load_packet(lanes, packet);
    for (size_t i = 0; i < shadow.size(); ++i) {
      const auto far = static_cast<float>(shadow[i].distance * (1.0 - kLightClearance));
      if (packet.valid[i] != 0 && !(far >= 0.0F)) {
        packet.valid[i] = 0;
        ++refused;
      }
      packet.rays.ray.tfar[i] = packet.valid[i] != 0 ? far : 0.0F;
    }
    occluded16(packet.valid, scene, packet.rays.ray, render::Coherence::Coherent);
    for (size_t i = 0; i < shadow.size(); ++i)
      if (packet.valid[i] != 0 && packet.rays.ray.tfar[i] >= 0.0F)
        light[shadow[i].target] += shadow[i].light;
  }
  return refused;
}

Probe::Probe(const render::Scene& scene) : scene_(scene) {}

uint64_t Probe::trace(std::span<const ProbeRay> rays, HoleGuard guard,
                      std::span<ProbeHit> hits) const {
  const render::FlushDenormals flush;
  render::FrameCounts counts;
  render::RayPacket packet;
  render::shading_kernel::Surfaces surfaces{};
  std::vector<render::PathRay> lanes;
  for (size_t begin = 0; begin < rays.size(); begin += render::kPacket) {
    lanes.clear();
    for (const ProbeRay& ray : rays.subspan(begin, std::min(render::kPacket, rays.size() - begin)))
      lanes.push_back(path_ray(ray));
    (void)load_packet(lanes, packet);
    intersect16(packet.valid, scene_.embree, packet.rays, render::Coherence::Coherent);
    if (guard == HoleGuard::On) fill_holes(scene_, kStepMm, packet, counts);
    render::shading_kernel_for(best_isa())
        .find_surfaces(scene_.shading->tables(), &packet.rays.ray.org_x[0], packet.valid, surfaces);
    for (size_t k = 0; k < lanes.size(); ++k) hits[begin + k] = probe_hit(packet, surfaces, k);
  }
  return counts.filled_holes;
}

void Probe::leave(std::span<const ProbeHit> hits, std::span<const Vec3> directions,
                  std::span<uint8_t> blocked) const {
  const render::FlushDenormals flush;
  std::vector<ShadowRay> rays;
  std::vector<double> light(hits.size(), 0.0);
  for (size_t k = 0; k < hits.size(); ++k) {
    light[k] = hits[k].what == ProbeHit::What::Surface ? 0.0 : 1.0;
    if (hits[k].what != ProbeHit::What::Surface) continue;
    rays.push_back({.origin = hits[k].spawn_point,
                    .direction = directions[k],
                    .distance = kFar,
                    .light = 1.0,
                    .target = static_cast<uint32_t>(k)});
  }
  (void)add_unshadowed(scene_.embree, rays, light);
  for (size_t k = 0; k < hits.size(); ++k) blocked[k] = light[k] == 0.0 ? 1 : 0;
}

std::vector<Vec3> Probe::corners(size_t mesh) const {
  const std::vector<Vec3f>& positions = scene_.meshes.at(mesh).positions;
  std::vector<Vec3> corners;
  for (size_t k = 0; k + 1 < positions.size(); ++k) corners.emplace_back(positions[k]);
  return corners;
}

void PrimaryProbe::lines(int tile_index, std::vector<Line>& out) const {
  const render::FlushDenormals flush;
  const render::Tile tile = plan_.tile(tile_index);
  const Affine panel_from_scene = scene_.scene_from_panel.inverse();
  render::PrimaryPackets::Maker maker(packets_);
  std::vector<render::RayPacket> packets(1);
  init_packets(packets);
  maker.start(scene_, tile, footprint_);
  maker.prepare(packets);
  out.clear();
  for (int column = 0; column < tile.columns; ++column) {
    maker.columns(column, packets);
    for (size_t r = 0; r < render::kPacket; ++r) {
      if (packets[0].valid[r] == 0) continue;
      const render::PanelRay line = panel_ray(panel_from_scene, packets[0], r);
      out.push_back({.row = tile.row_begin + static_cast<int>(r),
                     .subpixel = plan_.subpixel(tile, column, static_cast<int>(r)),
                     .x_mm = line.x_mm,
                     .y_mm = line.y_mm,
                     .tan_x = line.tan_x,
                     .tan_y = line.tan_y});
    }
  }
}

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

constexpr double kElsewhere = 0.01;  // mm

void compare_row(const RowTracer::Seen& traced, const render::SweptRow& swept,
                 SweepDifference& sum) {
  for (size_t s = 0; s < traced.hits.size(); ++s) {
    const render::Hit& hit = traced.hits[s];
    const bool met = hit.geometry < render::Hit::kRefused;
    const bool seen = swept.cut[s] != render::SweptRow::kNothing;
    ++sum.subpixels;
    if (!met && !seen) continue;
    sum.one_sees_none += met != seen ? 1 : 0;
    const render::SweptCut* cut = seen ? &swept.cuts[static_cast<size_t>(swept.cut[s])] : nullptr;
    const bool same =
        met && seen && cut->geometry == hit.geometry && cut->primitive == hit.primitive;
    sum.other_id += same ? 0 : 1;
    const double apart = met && seen ? std::abs(traced.z_mm[s] - swept.z_mm[s]) : kElsewhere + 1.0;
    sum.elsewhere += !same && apart > kElsewhere ? 1 : 0;
    if (same) sum.depth_mm = std::max(sum.depth_mm, apart);
  }
}

}  // namespace

RowTracer::RowTracer(const optics::OpticalModel& model, const render::Scene& scene)
    : model_(model),
      scene_(scene),
      evaluator_(model),
      start_mm_(render::primary_start_mm(scene.near_mm, model.rig().viewing.distance.value)) {}

void RowTracer::trace(int row, Seen& out) {
  evaluator_.evaluate(row, 0, model_.rig().panel.width_px, out.rays);
  const size_t count = out.rays.size();
  rays_.resize(count);
  out.hits.resize(count);
  out.z_mm.resize(count);
  const Affine& to_scene = scene_.scene_from_panel;
  const auto way = [&](size_t s) {
    return to_scene.vector({-out.rays.tan_x[s], -out.rays.tan_y[s], -1.0});
  };
  for (size_t s = 0; s < count; ++s) {
    render::PathRay& ray = rays_[s];
    ray.origin = to_scene.point({out.rays.lens_x_mm[s] + start_mm_ * out.rays.tan_x[s],
                                 out.rays.lens_y_mm[s] + start_mm_ * out.rays.tan_y[s], start_mm_});
    ray.direction = normalized(way(s));
    ray.target = 0;
  }
  (void)intersect(scene_.embree, rays_, render::Coherence::Incoherent, out.hits);
  for (size_t s = 0; s < count; ++s)
    out.z_mm[s] = start_mm_ - static_cast<double>(out.hits[s].distance) / length(way(s));
}

SweepDifference compare_with_embree(const render::RowPlanes& planes, const render::Scene& scene,
                                    int first, int step) {
  const render::RowSweep sweep(planes, scene);
  render::RowSweep::Worker worker(sweep);
  RowTracer tracer(planes.model(), scene);
  RowTracer::Seen traced;
  render::SweptRow swept;
  SweepDifference sum;
  for (int row = first; row < planes.rows(); row += step) {
    worker.sweep(row, swept);
    tracer.trace(row, traced);
    compare_row(traced, swept, sum);
  }
  return sum;
}

namespace {

class VisibilityTimer {
 public:
  VisibilityTimer(const render::Scene& scene, const optics::OpticalModel& model, int threads)
      : scene_(scene),
        plan_(model.rig()),
        packets_(model, plan_),
        footprint_(model, {}),
        rays_(3 * static_cast<uint64_t>(model.rig().panel.width_px) *
              static_cast<uint64_t>(model.rig().panel.height_px)),
        arena_(render::arena_threads(threads)) {}

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
    intersect16(packet.valid, scene_.embree, packet.rays, render::Coherence::Coherent);
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
}  // namespace lenticule::lab
