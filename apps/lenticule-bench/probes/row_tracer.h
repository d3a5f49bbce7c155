// SPDX-License-Identifier: Apache-2.0
// What Embree meets along a pixel row, for whoever compares the row sweep with it.
#pragma once

#include <cstdint>
#include <vector>

#include "optics/row_rays.h"
#include "render/accel/ray_stream.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Of one thread.
class RowTracer {
 public:
  /// Both must outlive it.
  RowTracer(const optics::OpticalModel& model, const Scene& scene);

  struct Seen {
    std::vector<Hit> hits;     ///< by subpixel
    std::vector<double> z_mm;  ///< panel frame; where something was met
    optics::RowRays rays;
  };
  /// The centre rays of all subpixels of a row, from the map itself.
  void trace(int row, Seen& out);

 private:
  const optics::OpticalModel& model_;
  const Scene& scene_;
  optics::RowRayEvaluator evaluator_;
  double start_mm_;
  std::vector<PathRay> rays_;
};

struct SweepDifference {
  uint64_t subpixels = 0;
  uint64_t other_id = 0;       ///< another surface, or one of the two sees none
  uint64_t one_sees_none = 0;  ///< part of those
  uint64_t elsewhere = 0;      ///< part of those: their depths differ by more than 0.01 mm, too
  double depth_mm = 0.0;       ///< largest difference of z where both see the same
};
/// Every `step`-th row from `first` on, against Embree.
[[nodiscard]] SweepDifference compare_with_embree(const RowPlanes& planes, const Scene& scene,
                                                  int first, int step);

struct SweepTiming {
  uint64_t subpixels = 0;
  double prepare_seconds = 0.0;  ///< of a frame, before its rows
  double seconds = 0.0;          ///< rows and preparation
  double rays_seconds = 0.0;     ///< of those: rays made and arranged, nothing cut
  double write_seconds = 0.0;    ///< bare writing of as many numbers as the rows bring
  uint64_t cuts = 0;
};
/// Sweeps every row once. `threads` 0 = all cores. Times are what the threads spend, over their
/// number.
[[nodiscard]] SweepTiming time_row_sweep(const RowPlanes& planes, const Scene& scene, int threads);

}  // namespace lenticule::render
