// SPDX-License-Identifier: Apache-2.0
#include "render/row_sweep/row_sweep.h"

#include <algorithm>
#include <limits>

#include "render/rays/primary_rays.h"

namespace lenticule::render {
namespace {

void make_room(size_t count, SweptRow& row) {
  if (row.cut.size() >= count) return;
  row.cut.resize(count);
  row.z_mm.resize(count);
  row.along.resize(count);
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
    std::fill(out.along.begin() + from, out.along.begin() + to, 0.0F);
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
                                  target.along.data(), target.cut.data());
  if (in_order) return see_nothing_beyond(out);
  for (size_t n = 0; n < rays_.end; ++n) {
    const auto s = static_cast<size_t>(rays_.subpixel[n]);
    out.cut[s] = by_lens_.cut[n];
    out.z_mm[s] = by_lens_.z_mm[n];
    out.along[s] = by_lens_.along[n];
  }
}

}  // namespace lenticule::render
