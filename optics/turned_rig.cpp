// SPDX-License-Identifier: Apache-2.0
// Turns the numbers of a rig. The lens coordinate is a linear form a x + b y of the panel point
// relative to the centre, with a = 3 / P and b = m a: swapping the axes swaps a and b, reversing an
// axis changes one sign. If a is negative afterwards, the lenses are numbered from the other end.
#include "optics/turned_rig.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "base/error.h"

namespace lenticule::optics {
namespace {

/// Returns a stripe layout if the offsets are those of stripes except for rounding.
SubpixelLayout with_usual_name(SubpixelLayout layout) {
  constexpr double kRounding = 1e-12;
  if (layout.table().size() != 1) return layout;
  for (const char* name : {"rgb", "bgr", "vrgb", "vbgr"}) {
    SubpixelLayout stripes = SubpixelLayout::named(name);
    bool same = true;
    for (int c = 0; c < 3; ++c) {
      const SubpixelOffset &ours = layout.offset(0, 0, c), &theirs = stripes.offset(0, 0, c);
      same = same && std::abs(ours.x_px - theirs.x_px) < kRounding &&
             std::abs(ours.y_px - theirs.y_px) < kRounding;
    }
    if (same) return stripes;
  }
  return layout;
}

ResidualMap turned_residual(const ResidualMap& map, const Mounting& mounting, double sign) {
  if (map.empty()) return map;
  const PixelGrid size = mounting.turned({map.columns, map.rows});
  ResidualMap out{
      .columns = size.width, .rows = size.height, .lenses = std::vector<double>(map.lenses.size())};
  const auto index = [](PixelPlace at, int columns) {
    return static_cast<size_t>(at.row) * static_cast<size_t>(columns) +
           static_cast<size_t>(at.column);
  };
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.columns; ++column)
      out.lenses[index(mounting.seen_place({column, row}, size), out.columns)] =
          sign * map.lenses[index({column, row}, map.columns)];
  return out;
}

LensSheet turned_sheet(const LensSheet& sheet, const Mounting& mounting) {
  // Both coefficients are multiplied by P / 3, which keeps a half turn free of rounding.
  double across = 1.0, down = sheet.slant;
  if (mounting.swapped) std::swap(across, down);
  if (std::abs(down) > kMaxSlant * std::abs(across))
    throw Error(ErrorKind::Input,
                fmt::format("mounting: a sheet of slant {} cannot be turned by 90 degrees: its "
                            "lenses would lie across the viewer's eyes",
                            sheet.slant),
                "measure or write the rig as the panel is seen, and add panel.mounting to it");
  if (mounting.reversed_columns) across = -across;
  if (mounting.reversed_rows) down = -down;
  const double sign = across < 0.0 ? -1.0 : 1.0;
  LensSheet out = sheet;
  out.pitch = Subpixels(sheet.pitch.value / std::abs(across));
  out.slant = down / across;
  out.offset = Lenses(sign * sheet.offset.value);
  // A channel's offset along the sent rows moves the phase by offset / P lenses.
  for (Subpixels& offset : out.channel_offset)
    offset = Subpixels(sign * offset.value / std::abs(across));
  out.residual = turned_residual(sheet.residual, mounting, sign);
  return out;
}

}  // namespace

SubpixelLayout turned_layout(const SubpixelLayout& layout, const Mounting& mounting,
                             PixelGrid sent) {
  const PixelGrid size = mounting.turned({layout.columns(), layout.rows()});
  std::vector<PixelCell> cells;
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      const PixelPlace at = mounting.inverse().seen_place({column, row}, sent);
      // A small table repeats to the left of and above the panel's first pixel, too.
      const auto wrapped = [](int value, int period) { return (value % period + period) % period; };
      PixelCell cell{};
      for (int c = 0; c < 3; ++c) {
        SubpixelOffset offset =
            layout.offset(wrapped(at.column, layout.columns()), wrapped(at.row, layout.rows()), c);
        if (mounting.swapped) std::swap(offset.x_px, offset.y_px);
        if (mounting.reversed_columns) offset.x_px = 1.0 - offset.x_px;
        if (mounting.reversed_rows) offset.y_px = 1.0 - offset.y_px;
        cell[static_cast<size_t>(c)] = offset;
      }
      cells.push_back(cell);
    }
  }
  return with_usual_name(SubpixelLayout::cells(size.width, size.height, std::move(cells)));
}

Rig turned_rig(const Rig& rig, const Mounting& mounting) {
  const Mounting turn = combined(rig.panel.mounting.inverse(), mounting);
  const PixelGrid before{rig.panel.width_px, rig.panel.height_px};
  const PixelGrid size = turn.turned(before);
  Rig out = rig;
  out.panel.mounting = mounting;
  out.panel.width_px = size.width;
  out.panel.height_px = size.height;
  if (turn.swapped) std::swap(out.panel.pixel_width, out.panel.pixel_height);
  out.panel.layout = turned_layout(rig.panel.layout, turn, before);
  out.sheet = turned_sheet(rig.sheet, turn);
  validate_rig(out, "rig turned to mounting '" + mounting_name(mounting) + "'");
  return out;
}

}  // namespace lenticule::optics
