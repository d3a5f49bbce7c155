// SPDX-License-Identifier: Apache-2.0
#include "render/rays/tile.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {
namespace {

bool subpixels_are_side_by_side(const optics::SubpixelLayout& layout) {
  return layout.name() == "rgb" || layout.name() == "bgr";
}

BeamSize beam_of(const optics::Rig& rig) {
  const double pixel_mm = rig.panel.pixel_width.value;
  const double subpixel_mm =
      subpixels_are_side_by_side(rig.panel.layout) ? pixel_mm / 3.0 : pixel_mm;
  const double gap_mm = rig.sheet.gap.value;
  // A lens no wider than a pixel shows a single view; there is no neighbouring one.
  const bool has_views = gap_mm > 0.0 && rig.sheet.pitch.value > 3.0;
  return {.lens_mm = rig.sheet.pitch.value * pixel_mm / 3.0,
          .row_mm = rig.panel.pixel_height.value,
          .subpixels_per_gap = has_views ? subpixel_mm / gap_mm : 0.0,
          .inverse_distance = 1.0 / rig.viewing.distance.value};
}

int ceiling_quotient(int a, int b) {
  return (a + b - 1) / b;
}

}  // namespace

TilePlan::TilePlan(const optics::Rig& rig)
    : width_(rig.panel.width_px), height_(rig.panel.height_px), beam_(beam_of(rig)) {
  // If the three subpixels of a pixel are not thirds of a row, columns move by whole pixels.
  const int step = subpixels_are_side_by_side(rig.panel.layout) ? 1 : 3;
  for (int row = 0; row < kRows; ++row)
    shifts_[static_cast<size_t>(row)] =
        step * static_cast<int>(std::lround(3.0 * rig.sheet.slant * row / step));
  const int drift = shifts_.back();
  first_column_ = std::min(0, drift);
  bands_ = ceiling_quotient(height_, kRows);
  per_band_ = ceiling_quotient(row_subpixels() + std::abs(drift), kColumns);
}

Tile TilePlan::tile(int index) const {
  const int row_begin = index / per_band_ * kRows;
  return {.row_begin = row_begin,
          .rows = std::min(kRows, height_ - row_begin),
          .column_begin = first_column_ + index % per_band_ * kColumns,
          .columns = kColumns};
}

}  // namespace lenticule::render
