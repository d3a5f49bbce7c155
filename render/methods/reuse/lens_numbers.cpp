// SPDX-License-Identifier: Apache-2.0
#include "render/methods/reuse/lens_numbers.h"

#include <algorithm>

namespace lenticule::render {

LensNumbers::LensNumbers(const optics::OpticalModel& model, const TilePlan& plan)
    : model_(model), plan_(plan), straight_(model.rig().sheet.residual.empty()) {
  if (!straight_) return;
  const optics::Panel& panel = model.rig().panel;
  lines_.reserve(static_cast<size_t>(panel.height_px) * 3);
  for (int row = 0; row < panel.height_px; ++row)
    for (int channel = 0; channel < 3; ++channel)
      lines_.push_back(line(row, channel, panel.width_px / 2, panel.width_px / 2));
}

/// Fits the line through two rays. Rays pass the panel on the apex line of their lens, which is a
/// point in one row. A residual map shifts these points; over the width of a tile the shift is
/// close enough to linear.
LensNumbers::Line LensNumbers::line(int row, int channel, int left_px, int right_px) const {
  const optics::SubpixelRay left = model_.ray(left_px, row, channel);
  const optics::SubpixelRay right = model_.ray(right_px, row, channel);
  Line line{.per_mm = 1.0 / model_.pitch_mm()};
  if (right.lens != left.lens)
    line.per_mm = static_cast<double>(right.lens - left.lens) / (right.lens_x_mm - left.lens_x_mm);
  line.offset = static_cast<double>(left.lens) - line.per_mm * left.lens_x_mm;
  return line;
}

LensNumbers::Line LensNumbers::line_at(int row, int channel, double x_mm) const {
  if (straight_) return lines_[static_cast<size_t>(3 * row + channel)];
  constexpr int kNear = 32;
  const optics::Panel& panel = model_.rig().panel;
  const int last_px = panel.width_px - 1;
  const int px = std::clamp(static_cast<int>(panel.x_px(x_mm)), 0, last_px);
  return line(row, channel, std::max(px - kNear, 0), std::min(px + kNear, last_px));
}

void LensNumbers::expand(const Tile& tile, Maps& maps) const {
  const optics::Panel& panel = model_.rig().panel;
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < TilePlan::kRows; ++lane) {
      const int row = std::min(tile.row_begin + lane, panel.height_px - 1);
      const int first = plan_.subpixel(tile, 0, lane);
      const int channel = ((first + k) % 3 + 3) % 3;
      const int last_px = panel.width_px - 1;
      const Line found = straight_ ? lines_[static_cast<size_t>(3 * row + channel)]
                                   : line(row, channel, std::clamp(first / 3, 0, last_px),
                                          std::clamp((first + tile.columns) / 3, 0, last_px));
      reprojection::LensMap& map = maps[static_cast<size_t>(k)];
      map.offset[lane] = static_cast<float>(found.offset);
      map.per_mm[lane] = static_cast<float>(found.per_mm);
    }
}

}  // namespace lenticule::render
