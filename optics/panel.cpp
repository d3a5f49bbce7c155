// SPDX-License-Identifier: Apache-2.0
// Subpixel layouts: stripes by name, cells by table.
#include "optics/panel.h"

#include <cmath>
#include <utility>

#include "base/error.h"

namespace lenticule::optics {
namespace {

constexpr int kMaxCellsPerSide = 64;
constexpr double kMaxOffsetPixels = 2.0;

PixelCell stripes_across(double red, double green, double blue) {
  return {{{red, 0.5}, {green, 0.5}, {blue, 0.5}}};
}

PixelCell stripes_down(double red, double green, double blue) {
  return {{{0.5, red}, {0.5, green}, {0.5, blue}}};
}

bool is_sane(const SubpixelOffset& offset) {
  // The comparisons are written so that a NaN fails.
  return std::abs(offset.x_px) <= kMaxOffsetPixels && std::abs(offset.y_px) <= kMaxOffsetPixels;
}

}  // namespace

SubpixelLayout::SubpixelLayout() : SubpixelLayout(named("rgb")) {}

SubpixelLayout::SubpixelLayout(std::string name, int columns, int rows,
                               std::vector<PixelCell> cells)
    : name_(std::move(name)), columns_(columns), rows_(rows), cells_(std::move(cells)) {}

SubpixelLayout SubpixelLayout::rgb() {
  return named("rgb");
}
SubpixelLayout SubpixelLayout::bgr() {
  return named("bgr");
}
SubpixelLayout SubpixelLayout::vrgb() {
  return named("vrgb");
}
SubpixelLayout SubpixelLayout::vbgr() {
  return named("vbgr");
}

SubpixelLayout SubpixelLayout::named(const std::string& name) {
  constexpr double kFirst = 1.0 / 6.0, kSecond = 0.5, kThird = 5.0 / 6.0;
  if (name == "rgb") return {name, 1, 1, {stripes_across(kFirst, kSecond, kThird)}};
  if (name == "bgr") return {name, 1, 1, {stripes_across(kThird, kSecond, kFirst)}};
  if (name == "vrgb") return {name, 1, 1, {stripes_down(kFirst, kSecond, kThird)}};
  if (name == "vbgr") return {name, 1, 1, {stripes_down(kThird, kSecond, kFirst)}};
  throw Error(ErrorKind::Input, "subpixel layout '" + name + "': not a known name",
              "use rgb, bgr, vrgb, vbgr or a table of cells");
}

SubpixelLayout SubpixelLayout::cells(int columns, int rows, std::vector<PixelCell> cells) {
  if (columns < 1 || rows < 1 || columns > kMaxCellsPerSide || rows > kMaxCellsPerSide) {
    throw Error(ErrorKind::Input, "subpixel layout: columns and rows must be 1 to 64");
  }
  const size_t expected = static_cast<size_t>(columns) * static_cast<size_t>(rows);
  if (cells.size() != expected) {
    throw Error(ErrorKind::Input, "subpixel layout: " + std::to_string(cells.size()) +
                                      " cells where columns * rows = " + std::to_string(expected));
  }
  for (const PixelCell& cell : cells) {
    for (const SubpixelOffset& offset : cell) {
      if (!is_sane(offset)) {
        throw Error(ErrorKind::Input, "subpixel layout: an offset is not within -2 to 2 pixels");
      }
    }
  }
  return {"cells", columns, rows, std::move(cells)};
}

}  // namespace lenticule::optics
