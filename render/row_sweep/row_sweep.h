// SPDX-License-Identifier: Apache-2.0
// RowSweep computes the exact primary visibility of whole pixel rows (docs/render/methods.md):
//
// 1. RowPlanes (row_planes.h) gives the plane that all rays of a row lie in, and these rays.
// 2. SweepPrimitives finds the primitives that the plane may cut, and cuts them: a triangle in a
//    segment, a sphere or a cone in a conic. In the plane, visibility has two dimensions only.
// 3. PlaneCells arranges the rays as [place under the lens][lens], so that neighbours in memory are
//    nearly parallel rays through neighbouring lenses.
// 4. The kernel sweeps each cut over the cells that can meet it, a range of lenses per place, and
//    keeps the nearest point of each ray.
// 5. The results are put back into the order of subpixels.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep_kernel.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// PlaneCells holds the rays of one plane in the memory layout that the sweep needs. It belongs to
/// one thread and keeps its memory from plane to plane.
class PlaneCells {
 public:
  /// Arranges rays as [place under the lens][lens]; all cells are reset to seeing nothing. Adds
  /// padding to `rays`. Lifetime: `rays` must stay unchanged until the next arrange().
  void arrange(const sweep_kernel::Kernel& kernel, double inverse_z, PlaneRays& rays);

  [[nodiscard]] const sweep_kernel::Cells& cells() const { return cells_; }
  [[nodiscard]] const sweep_kernel::Spread& spread() const { return spread_; }
  /// Returns the first ray of each lens, followed by the number of rays.
  [[nodiscard]] const int32_t* first() const { return first_.data(); }
  /// Returns the number of elements that arrays over rays must have for the kernel.
  [[nodiscard]] size_t padded_rays() const { return padded_rays_; }

 private:
  void number_lenses(const PlaneRays& rays);
  void set_buffers();
  void set_steps(double inverse_z, const PlaneRays& rays);
  void set_extremes();

  sweep_kernel::Cells cells_{};
  sweep_kernel::Spread spread_{};
  std::vector<int32_t> first_;
  std::vector<float> floats_;
  std::vector<int32_t> cuts_;
  std::vector<float> ranges_;
  size_t padded_rays_ = 0;
};

/// SweptCut names the primitive that a plane cuts, by Embree's numbers.
struct SweptCut {
  uint32_t geometry = 0;
  uint32_t primitive = 0;
};

/// The cuts of one plane, triangles first.
struct PlaneCuts {
  std::vector<sweep_kernel::Segment> segments;
  std::vector<sweep_kernel::Conic> conics;
  std::vector<uint32_t> curved;  ///< numbers of the spheres and cones to cut
};

/// SweepPrimitives serves one scene and rig. Thread safety: immutable, usable from any thread.
/// Lifetime: the scene must outlive the object.
class SweepPrimitives {
 public:
  /// Takes all primitives behind z = start_mm.
  SweepPrimitives(const Scene& scene, const RowPlanes& planes, double start_mm);

  /// Cuts the primitives with a plane of `row`. Appends their numbers to `numbers`: those of the
  /// segments, then of the conics.
  void cut(int row, const RowPlane& plane, PlaneCuts& out, std::vector<SweptCut>& numbers) const;

 private:
  struct Triangle {
    uint32_t corner[3];  ///< indices in corners_
    uint32_t geometry;
    uint32_t primitive;
    bool wide;
  };
  struct Quadric;

  void add_mesh(const MeshShape& mesh, uint32_t geometry);
  void find_rows();
  /// Returns the range of heights on the panel, projected from the viewing line, of the part behind
  /// start.
  [[nodiscard]] Interval heights_of(const Triangle& triangle,
                                    const std::vector<double>& corner_heights) const;
  [[nodiscard]] Interval heights_of(const Box& panel_box) const;
  [[nodiscard]] double height_of(double y, double z) const;
  [[nodiscard]] RowRange rows_of(const Interval& heights) const;

  void cut_triangle(const Triangle& triangle, const RowPlane& plane, PlaneCuts& out,
                    std::vector<SweptCut>& numbers) const;
  void cut_quadric(uint32_t number, const RowPlane& plane, PlaneCuts& out,
                   std::vector<SweptCut>& numbers) const;
  [[nodiscard]] Quadric quadric(uint32_t number) const;

  const Scene& scene_;
  const RowPlanes& planes_;
  double start_mm_;
  Affine panel_from_scene_;
  std::vector<Vec3> corners_;
  std::vector<Triangle> triangles_;
  std::vector<Box> boxes_;  ///< boxes of spheres, then of cones
  uint32_t sphere_geometry_ = 0;
  uint32_t cone_geometry_ = 0;
  RowBuckets rows_;
};

/// Visibility of the subpixels 3 i + channel of a row. Arrays have at least sixteen elements more
/// than the row has subpixels.
struct SweptRow {
  static constexpr int32_t kNothing = -1;

  std::vector<int32_t> cut;        ///< index into `cuts`, or kNothing
  std::vector<float> z_mm;         ///< panel frame; -infinity if nothing is visible
  std::vector<float> x_mm, tan_x;  ///< the rays, if PlaneRays are in another order
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
