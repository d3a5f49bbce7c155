// SPDX-License-Identifier: Apache-2.0
// SweepPrimitives holds a scene's primitives in the panel frame and cuts them with the planes of
// pixel rows.
#pragma once

#include <cstdint>
#include <vector>

#include "render/row_sweep/row_buckets.h"
#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep_kernel.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// SweptCut is the cut of a plane with one primitive. A triangle's cut is a segment: at parameter a
/// the point is x = x0 + a (x1 - x0) and so on; u and v are Embree's barycentrics. The cuts of
/// spheres and cones have no parameter, and all these members are zero.
struct SweptCut {
  uint32_t geometry = 0;  ///< Embree's numbers
  uint32_t primitive = 0;
  float x0 = 0.0F, z0 = 0.0F, x1 = 0.0F, z1 = 0.0F;  ///< mm, panel frame
  float u0 = 0.0F, v0 = 0.0F, u1 = 0.0F, v1 = 0.0F;
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

  /// Cuts the primitives with a plane of `row`. Appends descriptions to `described`: segments, then
  /// conics.
  void cut(int row, const RowPlane& plane, PlaneCuts& out, std::vector<SweptCut>& described) const;

 private:
  struct Triangle {
    uint32_t corner[3];  ///< indices in corners_
    uint32_t geometry;
    uint32_t primitive;
    bool wide;
  };
  struct Quadric;

  void add_mesh(const MeshShape& mesh, uint32_t geometry);
  void add_quadric(const Box& box);
  void find_rows();
  /// Range of heights on the panel, projected from the viewing line, of the part behind start.
  struct Heights;
  [[nodiscard]] Heights heights_of(const Triangle& triangle,
                                   const std::vector<double>& corner_heights) const;
  [[nodiscard]] Heights heights_of(const Box& panel_box) const;
  [[nodiscard]] double height_of(double y, double z) const;
  [[nodiscard]] RowRange rows_of(const Heights& heights) const;

  void cut_triangle(const Triangle& triangle, const RowPlane& plane, PlaneCuts& out,
                    std::vector<SweptCut>& described) const;
  void cut_quadric(uint32_t number, const RowPlane& plane, PlaneCuts& out,
                   std::vector<SweptCut>& described) const;
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

}  // namespace lenticule::render
