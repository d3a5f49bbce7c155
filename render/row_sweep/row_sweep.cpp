// SPDX-License-Identifier: Apache-2.0
#include "render/row_sweep/row_sweep.h"

#include "render/primary_rays.h"

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
          primary_start_mm(scene.impl().near_mm, planes.model().rig().viewing.distance.value))),
      primitives_(scene.impl(), planes, start_mm_) {}

RowSweep::Worker::Worker(const RowSweep& sweep) : sweep_(sweep), maker_(sweep.planes_) {}

void RowSweep::Worker::sweep(int row, SweptRow& out) {
  out.cuts.clear();
  for (size_t plane = 0; plane < sweep_.planes_.planes_of(row); ++plane)
    sweep_plane(row, plane, out);
}

void RowSweep::Worker::sweep_plane(int row, size_t plane, SweptRow& out) {
  const sweep_kernel::Kernel& kernel = sweep_.planes_.kernel();
  maker_.make(row, plane, rays_);
  cells_.arrange(kernel, sweep_.planes_.inverse_z(), rays_);
  auto number = static_cast<int32_t>(out.cuts.size());
  sweep_.primitives_.cut(row, rays_.plane, cuts_, out.cuts);
  const auto segments = static_cast<int>(cuts_.segments.size());
  kernel.segments(cells_.cells(), cells_.spread(), sweep_.start_mm_, cuts_.segments.data(),
                  segments, number);
  number += segments;
  kernel.conics(cells_.cells(), cells_.spread(), sweep_.start_mm_, cuts_.conics.data(),
                static_cast<int>(cuts_.conics.size()), number);
  collect(out);
}

void RowSweep::Worker::collect(SweptRow& out) {
  const bool in_order = rays_.subpixel.empty();
  make_room(sweep_.planes_.row_subpixels() + sweep_kernel::kLanes, out);
  SweptRow& target = in_order ? out : by_lens_;
  make_room(cells_.padded_rays(), target);
  sweep_.planes_.kernel().to_rays(cells_.cells(), cells_.first(), target.z_mm.data(),
                                  target.along.data(), target.cut.data());
  if (in_order) return;
  for (size_t n = 0; n < rays_.count; ++n) {
    const auto s = static_cast<size_t>(rays_.subpixel[n]);
    out.cut[s] = by_lens_.cut[n];
    out.z_mm[s] = by_lens_.z_mm[n];
    out.along[s] = by_lens_.along[n];
  }
}

}  // namespace lenticule::render
