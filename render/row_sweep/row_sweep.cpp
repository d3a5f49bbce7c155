// SPDX-License-Identifier: Apache-2.0
#include "render/row_sweep/row_sweep.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "render/rays/primary_rays.h"

namespace lenticule::render {
namespace {

constexpr size_t kLanes = sweep_kernel::kLanes;

constexpr size_t rounded_up(size_t count) { return (count + kLanes - 1) / kLanes * kLanes; }

/// Returns the first element at a vector boundary; the buffer has space for the shift.
template <class T>
T* at_vector(T* elements) {
  constexpr size_t kBytes = kLanes * sizeof(T);
  void* at = elements;
  size_t room = 2 * kBytes;
  return static_cast<T*>(std::align(kBytes, kBytes, at, room));
}

/// Returns the row stride; ranges may start at the last lens and extend over kLanes.
size_t stride_for(size_t lenses) {
  const size_t stride = rounded_up(lenses + kLanes);
  // Rows a power of two apart would map to the same cache sets.
  return stride % 128 == 0 ? stride + kLanes : stride;
}

}  // namespace

void PlaneCells::arrange(const sweep_kernel::Kernel& kernel, double inverse_z, PlaneRays& rays) {
  number_lenses(rays);
  set_buffers();
  padded_rays_ = rays.end + static_cast<size_t>(cells_.places) + 2 * kLanes;
  if (rays.x_mm.size() < padded_rays_) rays.x_mm.resize(padded_rays_);
  if (rays.tan_x.size() < padded_rays_) rays.tan_x.resize(padded_rays_);
  set_steps(inverse_z, rays);
  kernel.to_cells(rays.x_mm.data(), rays.tan_x.data(), first_.data(), cells_, spread_);
  set_extremes();
}

void PlaneCells::number_lenses(const PlaneRays& rays) {
  const auto count = static_cast<int32_t>(rays.end);
  const int32_t* lens = rays.lens.data();
  first_.clear();
  int32_t places = 0;
  for (auto n = static_cast<int32_t>(rays.first), guess = 1; n < count;) {
    first_.push_back(n);
    // The numbers of places of two lenses differ by at most one, so the last lens predicts the
    // next.
    int32_t end = std::min(n + guess, count);
    while (end < count && lens[end] == lens[n]) ++end;
    while (lens[end - 1] != lens[n]) --end;
    guess = end - n;
    places = std::max(places, guess);
    n = end;
  }
  // If lenses are very unequal, each ray counts as its own lens.
  const size_t made = rays.end - rays.first;
  if (static_cast<size_t>(places) * stride_for(first_.size()) > 16 * made + 4096) {
    first_.resize(made);
    std::iota(first_.begin(), first_.end(), static_cast<int32_t>(rays.first));
    places = 1;
  }
  cells_.lenses = static_cast<int>(first_.size());
  cells_.places = places;
  cells_.stride = static_cast<int>(stride_for(first_.size()));
  first_.resize(static_cast<size_t>(cells_.stride) + kLanes, count);
}

void PlaneCells::set_buffers() {
  const size_t places = rounded_up(static_cast<size_t>(cells_.places));
  const size_t size = places * static_cast<size_t>(cells_.stride);
  if (floats_.size() < 3 * size + kLanes) floats_.resize(3 * size + kLanes);
  if (cuts_.size() < size + kLanes) cuts_.resize(size + kLanes);
  cells_.x = at_vector(floats_.data());
  cells_.tan = cells_.x + size;
  cells_.z = cells_.tan + size;
  cells_.cut = at_vector(cuts_.data());
  ranges_.assign(4 * places, 0.0F);
  spread_.x_low = ranges_.data();
  spread_.x_high = spread_.x_low + places;
  spread_.tan_low = spread_.x_high + places;
  spread_.tan_high = spread_.tan_low + places;
}

/// Sets the steps along a row. All rays under a lens meet in one point, and all rays meet the
/// viewing line: along a row, tan changes by -1/Z times the change of x, apart from the place under
/// the lens.
void PlaneCells::set_steps(double inverse_z, const PlaneRays& rays) {
  const auto lenses = static_cast<size_t>(cells_.lenses);
  double step = 1.0;
  if (lenses > 1) {
    const double left = rays.x_mm[rays.first];
    const double right = rays.x_mm[static_cast<size_t>(first_[lenses - 1])];
    step = (right - left) / (cells_.lenses - 1);
  }
  spread_.x_step = static_cast<float>(step);
  spread_.tan_step = static_cast<float>(-step * inverse_z);
}

void PlaneCells::set_extremes() {
  spread_.x_far = spread_.tan_far = 0.0F;
  for (int n = 0; n < cells_.places; ++n) {
    spread_.x_far =
        std::max({spread_.x_far, std::abs(spread_.x_low[n]), std::abs(spread_.x_high[n])});
    spread_.tan_far =
        std::max({spread_.tan_far, std::abs(spread_.tan_low[n]), std::abs(spread_.tan_high[n])});
  }
  const auto lenses = static_cast<float>(cells_.lenses);
  spread_.x_far += std::abs(spread_.x_step) * lenses;
  spread_.tan_far += std::abs(spread_.tan_step) * lenses;
}

namespace {

using sweep_kernel::PlaneForm;
using sweep_kernel::Reach;
using sweep_kernel::Segment;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

float below(double v) {
  return std::nextafter(static_cast<float>(v), -std::numeric_limits<float>::infinity());
}
float above(double v) { return -below(-v); }

/// CutEnd is one end of a triangle's cut. The point is computed from the corner on the negative
/// side toward the other, in every triangle: neighbours get the same bits, and no ray passes
/// between them.
struct CutEnd {
  double x = 0.0, z = 0.0;
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
  return {.x = a.x + part * (b.x - a.x), .z = a.z + part * (b.z - a.z)};
}

CutEnd between(const CutEnd& a, const CutEnd& b, double part) {
  return {.x = a.x + part * (b.x - a.x), .z = a.z + part * (b.z - a.z)};
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

Segment segment_of(const CutEnd& a, const CutEnd& b, double start) {
  const auto f = [](double v) { return static_cast<float>(v); };
  const CutEnd from = behind(a, b, start), to = behind(b, a, start);
  return {.reach = {{f(from.z), f(to.z)}, {f(from.x), f(to.x)}, {f(from.x), f(to.x)}},
          .x0 = f(a.x),
          .z0 = f(a.z),
          .x1 = f(b.x),
          .z1 = f(b.z)};
}

/// Directions in the scene frame, per millimetre of x and of z in a row's plane.
struct PlaneAxes {
  Vec3 across, inward;
};

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
  for (const SphereShape& sphere : scene.spheres)
    boxes_.push_back(box_of(sphere, panel_from_scene_));
  for (const ConeShape& cone : scene.cones) boxes_.push_back(box_of(cone, panel_from_scene_));
  find_rows();
}

void SweepPrimitives::add_mesh(const MeshShape& mesh, uint32_t geometry) {
  const auto first = static_cast<uint32_t>(corners_.size());
  corners_.reserve(corners_.size() + mesh.positions.size());
  for (const Vec3f& p : mesh.vertices()) corners_.push_back(panel_from_scene_.point(Vec3(p)));
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

Interval SweepPrimitives::heights_of(const Triangle& triangle,
                                     const std::vector<double>& corner_heights) const {
  Interval out;
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

Interval SweepPrimitives::heights_of(const Box& panel_box) const {
  Interval out;
  if (panel_box.low.z > start_mm_) return out;
  for (const Vec3& p : panel_box.corners()) out.extend(height_of(p.y, std::min(p.z, start_mm_)));
  return out;
}

RowRange SweepPrimitives::rows_of(const Interval& heights) const {
  if (heights.empty()) return {};
  return planes_.rows_between(heights.low, heights.high);
}

void SweepPrimitives::cut(int row, const RowPlane& plane, PlaneCuts& out,
                          std::vector<SweptCut>& numbers) const {
  out.segments.clear();
  out.conics.clear();
  out.curved.clear();
  const auto triangles = static_cast<uint32_t>(triangles_.size());
  rows_.visit(row, [&](uint32_t number) {
    if (number < triangles)
      cut_triangle(triangles_[number], plane, out, numbers);
    else
      out.curved.push_back(number - triangles);
  });
  for (const uint32_t number : out.curved) cut_quadric(number, plane, out, numbers);
}

void SweepPrimitives::cut_triangle(const Triangle& triangle, const RowPlane& plane, PlaneCuts& out,
                                   std::vector<SweptCut>& numbers) const {
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
    numbers.push_back({triangle.geometry, triangle.primitive});
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
                                  std::vector<SweptCut>& numbers) const {
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
  out.conics.push_back({.reach = reach,
                        .form = form,
                        .s = dot(from_base(form.xc, form.zc), q.axis),
                        .s_x = dot(axes.across, q.axis),
                        .s_z = dot(axes.inward, q.axis),
                        .height = q.height});
  const bool sphere = number < scene_.spheres.size();
  const auto spheres = static_cast<uint32_t>(scene_.spheres.size());
  numbers.push_back({.geometry = sphere ? sphere_geometry_ : cone_geometry_,
                     .primitive = sphere ? number : number - spheres});
}

namespace {

void make_room(size_t count, SweptRow& row) {
  if (row.cut.size() >= count) return;
  row.cut.resize(count);
  for (auto* numbers : {&row.z_mm, &row.x_mm, &row.tan_x}) numbers->resize(count);
}

}  // namespace

RowSweep::RowSweep(const RowPlanes& planes, const Scene& scene)
    : planes_(planes),
      start_mm_(static_cast<float>(
          primary_start_mm(scene.near_mm, planes.model().rig().viewing.distance.value))),
      primitives_(scene, planes, start_mm_) {}

RowSweep::Worker::Worker(const RowSweep& sweep) : sweep_(sweep), maker_(sweep.planes_) {}

bool extend_by_view(Vec2 point, double inverse_z, const Interval& eyes, Interval& range_mm) {
  // Fraction of the distance to the viewing line beyond which content may be seen anywhere.
  constexpr double kTooNear = 0.995;
  if (!(point.y * inverse_z < kTooNear)) return false;
  const double wider = 1.0 / (1.0 - point.y * inverse_z);
  const double depth = inverse_z > 0.0 ? point.y * wider * inverse_z : point.y;
  for (const double eye : {eyes.low, eyes.high}) range_mm.extend(point.x * wider - eye * depth);
  return true;
}

void RowSweep::Worker::sweep(int row, SweptRow& out, const std::optional<Interval>& eyes,
                             const Interval& within_mm) {
  out.cuts.clear();
  for (size_t plane = 0; plane < sweep_.planes_.planes_of(row); ++plane)
    sweep_plane(row, plane, out, eyes, within_mm);
}

/// Returns the range on the panel of the rays to `eyes` that can meet a cut. From one place a cut
/// is seen between its ends, and from an intermediate place between the extremes of the outer
/// places.
Interval RowSweep::Worker::range_of_cuts_mm(const Interval& eyes) const {
  const double inverse_z = sweep_.planes_.inverse_z();
  Interval range;
  const auto add = [&](const sweep_kernel::Reach& reach) {
    for (const int end : {0, 1})
      for (const float x : {reach.x_low[end], reach.x_high[end]})
        if (!extend_by_view({double{x}, double{reach.z[end]}}, inverse_z, eyes, range))
          return false;
    return true;
  };
  for (const sweep_kernel::Segment& segment : cuts_.segments)
    if (!add(segment.reach)) return kEverywhere;
  for (const sweep_kernel::Conic& conic : cuts_.conics)
    if (!add(conic.reach)) return kEverywhere;
  return range;
}

void RowSweep::Worker::sweep_plane(int row, size_t plane, SweptRow& out,
                                   const std::optional<Interval>& eyes, const Interval& within_mm) {
  const sweep_kernel::Kernel& kernel = sweep_.planes_.kernel();
  auto number = static_cast<int32_t>(out.cuts.size());
  sweep_.primitives_.cut(row, sweep_.planes_.plane_of(row, plane), cuts_, out.cuts);
  Interval range = kEverywhere;
  if (eyes) {
    range = range_of_cuts_mm(*eyes);
    if (!within_mm.empty()) range.extend(within_mm);
  }
  maker_.make(row, plane, rays_, range);
  cells_.arrange(kernel, sweep_.planes_.inverse_z(), rays_);
  const auto segments = static_cast<int>(cuts_.segments.size());
  kernel.segments(cells_.cells(), cells_.spread(), sweep_.start_mm_, cuts_.segments.data(),
                  segments, number);
  number += segments;
  kernel.conics(cells_.cells(), cells_.spread(), sweep_.start_mm_, cuts_.conics.data(),
                static_cast<int>(cuts_.conics.size()), number);
  collect(out);
}

/// Marks subpixels whose rays were not made as seeing nothing.
void RowSweep::Worker::see_nothing_beyond(SweptRow& out) const {
  const auto clear = [&](size_t begin, size_t end) {
    const auto from = static_cast<std::ptrdiff_t>(begin), to = static_cast<std::ptrdiff_t>(end);
    std::fill(out.cut.begin() + from, out.cut.begin() + to, SweptRow::kNothing);
    std::fill(out.z_mm.begin() + from, out.z_mm.begin() + to,
              -std::numeric_limits<float>::infinity());
  };
  clear(0, rays_.first);
  clear(rays_.end, sweep_.planes_.row_subpixels());
}

void RowSweep::Worker::collect(SweptRow& out) {
  const bool in_order = rays_.subpixel.empty();
  make_room(sweep_.planes_.row_subpixels() + sweep_kernel::kLanes, out);
  SweptRow& target = in_order ? out : by_lens_;
  make_room(cells_.padded_rays(), target);
  sweep_.planes_.kernel().to_rays(cells_.cells(), cells_.first(), target.z_mm.data(),
                                  target.cut.data());
  if (in_order) return see_nothing_beyond(out);
  for (size_t n = 0; n < rays_.end; ++n) {
    const auto s = static_cast<size_t>(rays_.subpixel[n]);
    out.cut[s] = by_lens_.cut[n];
    out.z_mm[s] = by_lens_.z_mm[n];
    out.x_mm[s] = rays_.x_mm[n];
    out.tan_x[s] = rays_.tan_x[n];
  }
}

}  // namespace lenticule::render
