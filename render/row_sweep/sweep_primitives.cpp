// SPDX-License-Identifier: Apache-2.0
#include "render/row_sweep/sweep_primitives.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lenticule::render {
namespace {

using sweep_kernel::Conic;
using sweep_kernel::Reach;
using sweep_kernel::Segment;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

float below(double v) {
  return std::nextafter(static_cast<float>(v), -std::numeric_limits<float>::infinity());
}
float above(double v) {
  return -below(-v);
}

Vec3 corner_of(const Box& box, int n) {
  return {(n & 1) != 0 ? box.high.x : box.low.x, (n & 2) != 0 ? box.high.y : box.low.y,
          (n & 4) != 0 ? box.high.z : box.low.z};
}

/// Returns the axis-parallel box around a mapped box.
Box mapped(const Affine& map, const Box& box) {
  Box out{map.point(box.low), map.point(box.low)};
  for (int n = 1; n < 8; ++n) {
    const Vec3 p = map.point(corner_of(box, n));
    out.low = {std::min(out.low.x, p.x), std::min(out.low.y, p.y), std::min(out.low.z, p.z)};
    out.high = {std::max(out.high.x, p.x), std::max(out.high.y, p.y), std::max(out.high.z, p.z)};
  }
  return out;
}

/// CutEnd is one end of a triangle's cut. The point is computed from the corner on the negative
/// side toward the other, in every triangle: neighbours get the same bits, and no ray passes
/// between them.
struct CutEnd {
  double x = 0.0, z = 0.0;
  double weight[3] = {0.0, 0.0, 0.0};  ///< weights of the corners
};
struct CornerSide {
  const Vec3* point;
  double side;
  int index;
};
CutEnd cut_edge(const CornerSide& negative, const CornerSide& positive) {
  const double part = negative.side / (negative.side - positive.side);
  const Vec3& a = *negative.point;
  const Vec3& b = *positive.point;
  CutEnd end{.x = a.x + part * (b.x - a.x), .z = a.z + part * (b.z - a.z)};
  end.weight[negative.index] = 1.0 - part;
  end.weight[positive.index] = part;
  return end;
}

CutEnd between(const CutEnd& a, const CutEnd& b, double part) {
  CutEnd end{.x = a.x + part * (b.x - a.x), .z = a.z + part * (b.z - a.z)};
  for (int n = 0; n < 3; ++n) end.weight[n] = a.weight[n] + part * (b.weight[n] - a.weight[n]);
  return end;
}

/// Calls `use(begin, end)` for pieces of a cut that are not much longer than their distance, so
/// that single precision is accurate for each piece.
template <class Use>
void each_piece(const CutEnd& a, const CutEnd& b, const Use& use) {
  const double dx = b.x - a.x, dz = b.z - a.z;
  const double squared = dx * dx + dz * dz;
  if (!(squared > kWidest * kWidest)) return use(a, b);
  constexpr double kLonger = 8.0;
  const double nearest = -(a.x * dx + a.z * dz) / squared;
  double step = kWidest / std::sqrt(squared);
  std::vector<double> breaks = {0.0};
  const auto add = [&](double part) {
    if (part > 0.0 && part < 1.0) breaks.push_back(part);
  };
  for (; nearest - step > 0.0 || nearest + step < 1.0; step *= kLonger) {
    add(nearest - step);
    add(nearest + step);
  }
  breaks.push_back(1.0);
  std::sort(breaks.begin(), breaks.end());
  CutEnd begin = a;
  for (size_t n = 1; n < breaks.size(); ++n) {
    const CutEnd end = n + 1 < breaks.size() ? between(a, b, breaks[n]) : b;
    use(begin, end);
    begin = end;
  }
}

/// Moves an end in front of z = start to that plane; for ranges only.
CutEnd behind(const CutEnd& end, const CutEnd& other, double start) {
  if (end.z <= start) return end;
  const double part = (start - other.z) / (end.z - other.z);
  return {.x = other.x + part * (end.x - other.x), .z = start};
}

void set_reach(const CutEnd& a, const CutEnd& b, Reach& out) {
  const CutEnd* ends[2] = {&a, &b};
  for (int e = 0; e < 2; ++e) {
    out.z[e] = static_cast<float>(ends[e]->z);
    out.x_low[e] = out.x_high[e] = static_cast<float>(ends[e]->x);
  }
}

Segment segment_of(const CutEnd& a, const CutEnd& b, double start) {
  Segment segment{.reach = {},
                  .x0 = static_cast<float>(a.x),
                  .z0 = static_cast<float>(a.z),
                  .x1 = static_cast<float>(b.x),
                  .z1 = static_cast<float>(b.z)};
  set_reach(behind(a, b, start), behind(b, a, start), segment.reach);
  return segment;
}
SweptCut described_segment(const CutEnd& a, const CutEnd& b, const Segment& segment) {
  return {.x0 = segment.x0,
          .z0 = segment.z0,
          .x1 = segment.x1,
          .z1 = segment.z1,
          .u0 = static_cast<float>(a.weight[1]),
          .v0 = static_cast<float>(a.weight[2]),
          .u1 = static_cast<float>(b.weight[1]),
          .v1 = static_cast<float>(b.weight[2])};
}

/// A quadratic form that is zero on a cut: A x^2 + 2 B x z + C z^2 + 2 (gx x + gz z) + f, about
/// (xc, zc).
struct PlaneForm {
  double xc, zc;
  double A, B, C;
  double gx, gz;
  double f;
};

/// Directions in the scene frame, per millimetre of x and of z in a row's plane.
struct PlaneAxes {
  Vec3 across, inward;
};

Conic conic_of(const PlaneForm& f) {
  return {.reach = {},
          .xc = f.xc,
          .zc = f.zc,
          .a0 = f.C,
          .a1 = 2.0 * f.B,
          .a2 = f.A,
          .b0 = f.gz,
          .b1 = f.gx,
          .b2 = f.B,
          .b3 = f.A,
          .c0 = f.f,
          .c1 = 2.0 * f.gx,
          .c2 = f.A,
          .s0 = 0.0,
          .s1 = 0.0,
          .s2 = 0.0,
          .s3 = 0.0,
          .height = 0.0};
}

/// Bounds of a cut: those of an ellipse, or unbounded.
struct Extent {
  double x_low = -kInfinity, x_high = kInfinity, z_low = -kInfinity, z_high = kInfinity;
  bool empty = false;
};

/// Moves the form's origin to the ellipse's centre, so that no large numbers cancel later, and
/// bounds the ellipse.
Extent centre_ellipse(PlaneForm& q) {
  const double det = q.A * q.C - q.B * q.B;
  if (!(q.A > 0.0) || !(det > 1e-9 * q.A * std::abs(q.C))) return {};
  const double dx = (q.B * q.gz - q.C * q.gx) / det;
  const double dz = (q.B * q.gx - q.A * q.gz) / det;
  q.f += q.gx * dx + q.gz * dz;
  q.xc += dx;
  q.zc += dz;
  q.gx = q.gz = 0.0;
  if (q.f > 0.0) return {.empty = true};
  const double half_x = std::sqrt(-q.f * q.C / det), half_z = std::sqrt(-q.f * q.A / det);
  return {q.xc - half_x, q.xc + half_x, q.zc - half_z, q.zc + half_z};
}

/// Bounds the part of a cut inside its primitive's box and behind the start; returns false if it is
/// empty.
bool bound(const Extent& extent, const Box& box, double start, Reach& reach) {
  const double z_low = std::max(extent.z_low, box.low.z);
  const double z_high = std::min({extent.z_high, box.high.z, start});
  const double x_low = std::max(extent.x_low, box.low.x);
  const double x_high = std::min(extent.x_high, box.high.x);
  if (extent.empty || !(z_low <= z_high) || !(x_low <= x_high)) return false;
  reach = {
      {above(z_high), below(z_low)}, {below(x_low), below(x_low)}, {above(x_high), above(x_high)}};
  return true;
}

}  // namespace

/// Quadric is |p - base|^2 minus the squares of the component along the axis and of the radius
/// there; a sphere has no axis.
struct SweepPrimitives::Quadric {
  Vec3 base, axis;
  double radius, slope, height;

  [[nodiscard]] double form(Vec3 a, Vec3 b) const {
    return dot(a, b) - (1.0 + slope * slope) * dot(a, axis) * dot(b, axis);
  }
  /// Returns the form about a point of the plane at offset `from` from the base.
  [[nodiscard]] PlaneForm form_in(const PlaneAxes& plane, Vec3 from) const {
    const double taper = radius * slope;
    return {.xc = 0.0,
            .zc = 0.0,
            .A = form(plane.across, plane.across),
            .B = form(plane.across, plane.inward),
            .C = form(plane.inward, plane.inward),
            .gx = form(from, plane.across) - taper * dot(plane.across, axis),
            .gz = form(from, plane.inward) - taper * dot(plane.inward, axis),
            .f = form(from, from) - 2.0 * taper * dot(from, axis) - radius * radius};
  }
};

struct SweepPrimitives::Heights {
  double low = kInfinity;
  double high = -kInfinity;
  void extend(double height) {
    low = std::min(low, height);
    high = std::max(high, height);
  }
};

SweepPrimitives::SweepPrimitives(const Scene& scene, const RowPlanes& planes, double start_mm)
    : scene_(scene),
      planes_(planes),
      start_mm_(start_mm),
      panel_from_scene_(scene.scene_from_panel.inverse()),
      rows_(0, {}) {
  for (size_t g = 0; g < scene.geometries.size(); ++g) {
    const GeometryEntry& entry = scene.geometries[g];
    const auto number = static_cast<uint32_t>(g);
    if (entry.kind == GeometryEntry::Kind::Mesh) add_mesh(scene.meshes[entry.mesh], number);
    if (entry.kind == GeometryEntry::Kind::Spheres) sphere_geometry_ = number;
    if (entry.kind == GeometryEntry::Kind::Cones) cone_geometry_ = number;
  }
  for (const SphereShape& sphere : scene.spheres) add_quadric(box_of(sphere));
  for (const ConeShape& cone : scene.cones) add_quadric(box_of(cone));
  find_rows();
}

void SweepPrimitives::add_mesh(const MeshShape& mesh, uint32_t geometry) {
  const auto first = static_cast<uint32_t>(corners_.size());
  corners_.reserve(corners_.size() + mesh.positions.size());
  for (size_t n = 0; n + 1 < mesh.positions.size(); ++n)
    corners_.push_back(panel_from_scene_.point(Vec3(mesh.positions[n])));
  triangles_.reserve(triangles_.size() + mesh.triangles.size());
  for (size_t n = 0; n < mesh.triangles.size(); ++n) {
    const auto& t = mesh.triangles[n];
    const auto number = static_cast<uint32_t>(n);
    if (const WideTriangle* wide = scene_.wide_triangle(mesh, number)) {
      const auto own = static_cast<uint32_t>(corners_.size());
      for (const Vec3& corner : wide->corner) corners_.push_back(panel_from_scene_.point(corner));
      triangles_.push_back({{own, own + 1, own + 2}, geometry, number, true});
      continue;
    }
    triangles_.push_back({{first + t[0], first + t[1], first + t[2]}, geometry, number, false});
  }
}

void SweepPrimitives::add_quadric(const Box& box) {
  boxes_.push_back(mapped(panel_from_scene_, box));
}

void SweepPrimitives::find_rows() {
  std::vector<RowRange> ranges;
  ranges.reserve(triangles_.size() + boxes_.size());
  std::vector<double> corner_heights;
  corner_heights.reserve(corners_.size());
  for (const Vec3& p : corners_) corner_heights.push_back(height_of(p.y, p.z));
  for (const Triangle& triangle : triangles_)
    ranges.push_back(rows_of(heights_of(triangle, corner_heights)));
  for (const Box& box : boxes_) ranges.push_back(rows_of(heights_of(box)));
  rows_ = RowBuckets(planes_.rows(), ranges);
}

double SweepPrimitives::height_of(double y, double z) const {
  return (y - planes_.eye_tan_y() * z) / (1.0 - planes_.inverse_z() * z);
}

SweepPrimitives::Heights SweepPrimitives::heights_of(
    const Triangle& triangle, const std::vector<double>& corner_heights) const {
  Heights out;
  for (int n = 0; n < 3; ++n) {
    const Vec3& a = corners_[triangle.corner[n]];
    const Vec3& b = corners_[triangle.corner[(n + 1) % 3]];
    if (a.z <= start_mm_) out.extend(corner_heights[triangle.corner[n]]);
    if ((a.z <= start_mm_) == (b.z <= start_mm_)) continue;
    const double part = (start_mm_ - a.z) / (b.z - a.z);
    out.extend(height_of(a.y + part * (b.y - a.y), start_mm_));
  }
  return out;
}

SweepPrimitives::Heights SweepPrimitives::heights_of(const Box& panel_box) const {
  Heights out;
  if (panel_box.low.z > start_mm_) return out;
  for (int n = 0; n < 8; ++n) {
    const Vec3 p = corner_of(panel_box, n);
    out.extend(height_of(p.y, std::min(p.z, start_mm_)));
  }
  return out;
}

RowRange SweepPrimitives::rows_of(const Heights& heights) const {
  if (!(heights.low <= heights.high)) return {};
  return planes_.rows_between(heights.low, heights.high);
}

void SweepPrimitives::cut(int row, const RowPlane& plane, PlaneCuts& out,
                          std::vector<SweptCut>& described) const {
  out.segments.clear();
  out.conics.clear();
  out.curved.clear();
  const auto triangles = static_cast<uint32_t>(triangles_.size());
  rows_.visit(row, [&](uint32_t number) {
    if (number < triangles)
      cut_triangle(triangles_[number], plane, out, described);
    else
      out.curved.push_back(number - triangles);
  });
  for (const uint32_t number : out.curved) cut_quadric(number, plane, out, described);
}

void SweepPrimitives::cut_triangle(const Triangle& triangle, const RowPlane& plane, PlaneCuts& out,
                                   std::vector<SweptCut>& described) const {
  CornerSide corners[3];
  int above_plane = 0;
  for (int n = 0; n < 3; ++n) {
    const Vec3& p = corners_[triangle.corner[n]];
    corners[n] = {
        &p, (p.y - planes_.eye_tan_y() * p.z) - plane.lens_y_mm * (1.0 - planes_.inverse_z() * p.z),
        n};
    above_plane += corners[n].side >= 0.0 ? 1 << n : 0;
  }
  if (above_plane == 0 || above_plane == 7) return;
  // The corner that is alone on its side of the plane.
  constexpr int kAlone[8] = {0, 0, 1, 2, 2, 1, 0, 0};
  const CornerSide& alone = corners[kAlone[above_plane]];
  const CornerSide& next = corners[(alone.index + 1) % 3];
  const CornerSide& other = corners[(alone.index + 2) % 3];
  const bool alone_above = alone.side >= 0.0;
  const CutEnd a = alone_above ? cut_edge(next, alone) : cut_edge(alone, next);
  const CutEnd b = alone_above ? cut_edge(other, alone) : cut_edge(alone, other);
  const auto add = [&](const CutEnd& begin, const CutEnd& end) {
    if (!(std::min(begin.z, end.z) <= start_mm_)) return;
    out.segments.push_back(segment_of(begin, end, start_mm_));
    described.push_back(described_segment(begin, end, out.segments.back()));
    described.back().geometry = triangle.geometry;
    described.back().primitive = triangle.primitive;
  };
  triangle.wide ? each_piece(a, b, add) : add(a, b);
}

SweepPrimitives::Quadric SweepPrimitives::quadric(uint32_t number) const {
  if (number < scene_.spheres.size()) {
    const SphereShape& sphere = scene_.spheres[number];
    return {sphere.centre, {}, sphere.radius, 0.0, 1.0};
  }
  const ConeShape& cone = scene_.cones[number - scene_.spheres.size()];
  return {cone.base, cone.axis, cone.base_radius, cone.slope, cone.height};
}

void SweepPrimitives::cut_quadric(uint32_t number, const RowPlane& plane, PlaneCuts& out,
                                  std::vector<SweptCut>& described) const {
  const Box& box = boxes_[number];
  const Quadric q = quadric(number);
  const Affine& to_scene = scene_.scene_from_panel;
  const PlaneAxes axes{to_scene.column_x, to_scene.vector({0.0, plane.tan_y, 1.0})};
  const auto from_base = [&](double x, double z) {
    return to_scene.point({x, plane.lens_y_mm + plane.tan_y * z, z}) - q.base;
  };
  const double xc = (box.low.x + box.high.x) / 2.0, zc = (box.low.z + box.high.z) / 2.0;
  PlaneForm form = q.form_in(axes, from_base(xc, zc));
  form.xc = xc;
  form.zc = zc;
  Reach reach;
  if (!bound(centre_ellipse(form), box, start_mm_, reach)) return;
  out.conics.push_back(conic_of(form));
  Conic& conic = out.conics.back();
  conic.reach = reach;
  conic.s0 = dot(from_base(form.xc, form.zc), q.axis);
  conic.s1 = conic.s3 = dot(axes.across, q.axis);
  conic.s2 = dot(axes.inward, q.axis);
  conic.height = q.height;
  const bool sphere = number < scene_.spheres.size();
  const auto spheres = static_cast<uint32_t>(scene_.spheres.size());
  described.push_back({.geometry = sphere ? sphere_geometry_ : cone_geometry_,
                       .primitive = sphere ? number : number - spheres});
}

}  // namespace lenticule::render
