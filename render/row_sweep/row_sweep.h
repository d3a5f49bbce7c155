// SPDX-License-Identifier: Apache-2.0
// RowSweep computes the exact primary visibility of whole pixel rows: it intersects the scene with
// the common plane of a row's rays, and sweeps each cut over the rays that can meet it.
// docs/render/row-sweep.md.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "render/row_sweep/plane_cells.h"
#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/sweep_primitives.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Visibility of the subpixels 3 i + channel of a row. Arrays have at least sixteen elements more
/// than the row has subpixels.
struct SweptRow {
  static constexpr int32_t kNothing = -1;

  std::vector<int32_t> cut;  ///< index into `cuts`, or kNothing
  std::vector<float> z_mm;   ///< panel frame; -infinity if nothing is visible
  std::vector<float> along;  ///< parameter on the cut, 0 for spheres and cones
  std::vector<SweptCut> cuts;
};

/// Extends a range on the panel by the places from which a point (x, z) of a plane is seen by eyes
/// (mm on the viewing line; tangents of parallel rays). Returns false if the point is so near to
/// the viewing line that it may be seen from anywhere. `inverse_z` as in RowPlanes.
[[nodiscard]] bool extend_by_view(Vec2 point, double inverse_z, const Interval& eyes,
                                  Interval& range_mm);

/// RowSweep serves one scene on one rig. Content nearer than method full's near bound is left out,
/// as in method full. Among surfaces at the same depth the choice is deterministic. Thread safety:
/// immutable, usable from any thread.
class RowSweep {
 public:
  /// Lifetime: `planes` and `scene` must outlive the object. Throws only std::bad_alloc.
  RowSweep(const RowPlanes& planes, const Scene& scene);

  /// Worker sweeps rows. Thread safety: used by one thread. It keeps its memory from row to row and
  /// does not allocate after the fullest row. Rows in ascending order share more work.
  class Worker {
   public:
    /// Lifetime: `sweep` must outlive the object.
    explicit Worker(const RowSweep& sweep);
    /// Sweeps a row. If all rays go to `eyes` on the viewing line (mm; tangents of parallel rays),
    /// rays far from all objects may be left out, except those that leave the panel in `within_mm`.
    void sweep(int row, SweptRow& out, const std::optional<Interval>& eyes = {},
               const Interval& within_mm = {});
    /// Returns the rays of the last row's last plane.
    [[nodiscard]] const PlaneRays& rays() const { return rays_; }

   private:
    void sweep_plane(int row, size_t plane, SweptRow& out, const std::optional<Interval>& eyes,
                     const Interval& within_mm);
    [[nodiscard]] Interval range_of_cuts_mm(const Interval& eyes) const;
    void collect(SweptRow& out);
    void see_nothing_beyond(SweptRow& out) const;

    const RowSweep& sweep_;
    RowPlanes::Maker maker_;
    PlaneRays rays_;
    PlaneCells cells_;
    PlaneCuts cuts_;
    SweptRow by_lens_;  ///< results by lens, if rays are not in the order of subpixels
  };

 private:
  const RowPlanes& planes_;
  float start_mm_;
  SweepPrimitives primitives_;
};

}  // namespace lenticule::render
