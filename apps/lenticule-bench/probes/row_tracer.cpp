// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/probes/row_tracer.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "render/accel/denormals.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"

namespace lenticule::bench {
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

/// SweepTimer distributes consecutive rows in bands, one per thread.
class SweepTimer {
 public:
  SweepTimer(const render::RowPlanes& planes, const render::Scene& scene, int threads)
      : planes_(planes),
        scene_(scene),
        arena_(threads > 0 ? threads : tbb::task_arena::automatic) {}

  SweepTiming run() {
    const Clock::time_point start = Clock::now();
    const render::RowSweep sweep(planes_, scene_);
    SweepTiming timing;
    timing.prepare_seconds = seconds_since(start);
    timing.subpixels = planes_.row_subpixels() * static_cast<uint64_t>(planes_.rows());
    tbb::enumerable_thread_specific<Work> workers([&] { return Work(sweep, planes_); });
    arena_.execute([&] {
      tbb::parallel_for(0, (planes_.rows() + kBand - 1) / kBand, [&](int band) {
        const render::FlushDenormals flush;
        workers.local().time_band(planes_, band);
      });
    });
    for (const Work& work : workers) work.add_to(timing);
    const double threads = arena_.max_concurrency();
    timing.rays_seconds /= threads;
    timing.write_seconds /= threads;
    timing.seconds = timing.seconds / threads + timing.prepare_seconds;
    return timing;
  }

 private:
  static constexpr int kBand = 16;

  struct Work {
    Work(const render::RowSweep& sweep, const render::RowPlanes& planes)
        : worker(sweep), maker(planes) {}

    void time_band(const render::RowPlanes& planes, int band) {
      const int first = band * kBand;
      const int end = std::min(first + kBand, planes.rows());
      Clock::time_point start = Clock::now();
      for (int row = first; row < end; ++row) {
        worker.sweep(row, swept);
        cuts += swept.cuts.size();
      }
      sum.seconds += seconds_since(start);
      start = Clock::now();
      for (int row = first; row < end; ++row) make_rays(planes, row);
      sum.rays_seconds += seconds_since(start);
      start = Clock::now();
      for (int row = first; row < end; ++row) write(row);
      sum.write_seconds += seconds_since(start);
    }
    void make_rays(const render::RowPlanes& planes, int row) {
      for (size_t plane = 0; plane < planes.planes_of(row); ++plane) {
        maker.make(row, plane, rays);
        cells.arrange(planes.kernel(), planes.inverse_z(), rays);
      }
    }
    void write(int value) {
      std::fill(bare.cut.begin(), bare.cut.end(), value);
      std::fill(bare.z_mm.begin(), bare.z_mm.end(), static_cast<float>(value));
      std::fill(bare.along.begin(), bare.along.end(), static_cast<float>(value));
      if (bare.cut.size() == swept.cut.size()) return;
      bare.cut.resize(swept.cut.size());
      bare.z_mm.resize(swept.cut.size());
      bare.along.resize(swept.cut.size());
    }
    void add_to(SweepTiming& timing) const {
      timing.seconds += sum.seconds;
      timing.rays_seconds += sum.rays_seconds;
      timing.write_seconds += sum.write_seconds;
      timing.cuts += cuts;
    }

    render::RowSweep::Worker worker;
    render::RowPlanes::Maker maker;
    render::PlaneRays rays;
    render::PlaneCells cells;
    render::SweptRow swept, bare;
    SweepTiming sum;
    uint64_t cuts = 0;
  };

  const render::RowPlanes& planes_;
  const render::Scene& scene_;
  tbb::task_arena arena_;
};

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
  (void)intersect(scene_.embree.get(), rays_, render::Coherence::Incoherent, out.hits);
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

SweepTiming time_row_sweep(const render::RowPlanes& planes, const render::Scene& scene,
                           int threads) {
  return SweepTimer(planes, scene, threads).run();
}

}  // namespace lenticule::bench
