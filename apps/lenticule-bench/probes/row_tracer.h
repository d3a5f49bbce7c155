// SPDX-License-Identifier: Apache-2.0
// RowTracer traces a pixel row with Embree, as a reference for the row sweep.
#pragma once

#include <cstdint>
#include <vector>

#include "optics/row_rays.h"
#include "render/accel/ray_stream.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/scene.h"

namespace lenticule::bench {

/// Thread safety: one thread.
class RowTracer {
 public:
  /// Lifetime: both must outlive the tracer.
  RowTracer(const optics::OpticalModel& model, const render::Scene& scene);

  struct Seen {
    std::vector<render::Hit> hits;  ///< one per subpixel
    std::vector<double> z_mm;       ///< panel frame; set where a surface was hit
    optics::RowRays rays;
  };
  /// Traces the centre rays of all subpixels of a row, computed from the optical map itself.
  void trace(int row, Seen& out);

 private:
  const optics::OpticalModel& model_;
  const render::Scene& scene_;
  optics::RowRayEvaluator evaluator_;
  double start_mm_;
  std::vector<render::PathRay> rays_;
};

struct SweepDifference {
  uint64_t subpixels = 0;
  uint64_t other_id = 0;       ///< another surface, or only one of the two found a surface
  uint64_t one_sees_none = 0;  ///< part of those: only one found a surface
  uint64_t elsewhere = 0;      ///< part of those: the depths also differ by more than 0.01 mm
  double depth_mm = 0.0;       ///< largest difference of z where both found the same surface
};
/// Compares every `step`-th row, from `first` on, with Embree.
[[nodiscard]] SweepDifference compare_with_embree(const render::RowPlanes& planes,
                                                  const render::Scene& scene, int first, int step);

struct SweepTiming {
  uint64_t subpixels = 0;
  double prepare_seconds = 0.0;  ///< preparation of a frame, before its rows
  double seconds = 0.0;          ///< rows and preparation
  double rays_seconds = 0.0;     ///< part of those: making and arranging rays, without cutting
  double write_seconds = 0.0;    ///< writing as many numbers as the rows contain
  uint64_t cuts = 0;
};
/// Sweeps every row once. `threads` 0 = all cores. Times are the sum over the threads divided by
/// their number.
[[nodiscard]] SweepTiming time_row_sweep(const render::RowPlanes& planes,
                                         const render::Scene& scene, int threads);

}  // namespace lenticule::bench
