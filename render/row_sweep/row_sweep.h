// SPDX-License-Identifier: Apache-2.0
// Exact primary visibility of whole pixel rows: the scene is cut with the plane that a row's rays
// share, and each cut is swept over the rays that it can meet. docs/rendering.md, "Row sweep".
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "render/row_sweep/plane_cells.h"
#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/sweep_primitives.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// What the subpixels 3 i + channel of a row see. Arrays have at least sixteen elements more than
/// the row has subpixels.
struct SweptRow {
  static constexpr int32_t kNothing = -1;

  std::vector<int32_t> cut;  ///< index into `cuts`, or kNothing
  std::vector<float> z_mm;   ///< panel frame; -infinity where there is nothing
  std::vector<float> along;  ///< parameter on the cut, 0 for spheres and cones
  std::vector<SweptCut> cuts;
};

/// Of one scene on one rig; immutable, safe from any thread. What is nearer than method full's near
/// bound is left out here, too. Of surfaces at the same depth one is seen, always the same.
class RowSweep {
 public:
  /// Both must outlive it. Throws nothing but std::bad_alloc.
  RowSweep(const RowPlanes& planes, const Scene& scene);

  /// Scratch of one thread; keeps its memory from row to row, and does not allocate once it has
  /// swept the fullest row. Rows in ascending order share more work.
  class Worker {
   public:
    /// `sweep` must outlive it.
    explicit Worker(const RowSweep& sweep);
    /// If all rays go to `eyes` on the viewing line (mm; tangents of parallel rays), those that are
    /// far from everything need not be made.
    void sweep(int row, SweptRow& out, const std::optional<Interval>& eyes = {});
    /// The rays of the last row's last plane.
    [[nodiscard]] const PlaneRays& rays() const { return rays_; }

   private:
    void sweep_plane(int row, size_t plane, SweptRow& out, const std::optional<Interval>& eyes);
    [[nodiscard]] Interval range_of_cuts_mm(const Interval& eyes) const;
    void collect(SweptRow& out);
    void see_nothing_beyond(SweptRow& out) const;

    const RowSweep& sweep_;
    RowPlanes::Maker maker_;
    PlaneRays rays_;
    PlaneCells cells_;
    PlaneCuts cuts_;
    SweptRow by_lens_;  ///< where rays are not in the order of subpixels
  };

 private:
  const RowPlanes& planes_;
  float start_mm_;
  SweepPrimitives primitives_;
};

}  // namespace lenticule::render
