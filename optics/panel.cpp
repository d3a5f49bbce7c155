// SPDX-License-Identifier: Apache-2.0
// Subpixel layouts: stripes by name, cells by table.
#include "optics/panel.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error_kinds.h"

namespace lenticule::optics {
namespace {

struct NamedMounting {
  const char* name;
  Mounting mounting;
};

constexpr std::array<NamedMounting, 8> kMountings{{
    {"0", {}},
    {"90", {.swapped = true, .reversed_columns = true}},
    {"180", {.reversed_columns = true, .reversed_rows = true}},
    {"270", {.swapped = true, .reversed_rows = true}},
    {"mirrored", {.reversed_columns = true}},
    {"mirrored 90", {.swapped = true, .reversed_columns = true, .reversed_rows = true}},
    {"mirrored 180", {.reversed_rows = true}},
    {"mirrored 270", {.swapped = true}},
}};

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

PixelPlace Mounting::seen_place(PixelPlace sent, PixelGrid seen) const {
  if (swapped) std::swap(sent.column, sent.row);
  return {reversed_columns ? seen.width - 1 - sent.column : sent.column,
          reversed_rows ? seen.height - 1 - sent.row : sent.row};
}

Mounting Mounting::inverse() const {
  return swapped ? Mounting{true, reversed_rows, reversed_columns} : *this;
}

Mounting combined(const Mounting& first, const Mounting& second) {
  Mounting both = first;
  if (second.swapped) {
    both.swapped = !both.swapped;
    std::swap(both.reversed_columns, both.reversed_rows);
  }
  both.reversed_columns = both.reversed_columns != second.reversed_columns;
  both.reversed_rows = both.reversed_rows != second.reversed_rows;
  return both;
}

Mounting mounting_named(std::string_view name) {
  const auto found =
      std::ranges::find_if(kMountings, [name](const auto& entry) { return name == entry.name; });
  if (found != kMountings.end()) return found->mounting;
  throw input_error("mounting '{}': not a known name", name)
      .remedy("use 0, 90, 180 or 270 (degrees clockwise), alone or after 'mirrored'");
}

std::string mounting_name(const Mounting& mounting) {
  const auto found = std::ranges::find_if(
      kMountings, [&mounting](const auto& entry) { return mounting == entry.mounting; });
  LENTICULE_CHECK(found != kMountings.end());
  return found->name;
}

SubpixelLayout::SubpixelLayout() : SubpixelLayout(named("rgb")) {}

SubpixelLayout::SubpixelLayout(std::string name, int columns, int rows,
                               std::vector<PixelCell> cells)
    : name_(std::move(name)), columns_(columns), rows_(rows), cells_(std::move(cells)) {}

SubpixelLayout SubpixelLayout::rgb() { return named("rgb"); }
SubpixelLayout SubpixelLayout::bgr() { return named("bgr"); }
SubpixelLayout SubpixelLayout::vrgb() { return named("vrgb"); }
SubpixelLayout SubpixelLayout::vbgr() { return named("vbgr"); }

SubpixelLayout SubpixelLayout::named(const std::string& name) {
  constexpr double kFirst = 1.0 / 6.0, kSecond = 0.5, kThird = 5.0 / 6.0;
  if (name == "rgb") return {name, 1, 1, {stripes_across(kFirst, kSecond, kThird)}};
  if (name == "bgr") return {name, 1, 1, {stripes_across(kThird, kSecond, kFirst)}};
  if (name == "vrgb") return {name, 1, 1, {stripes_down(kFirst, kSecond, kThird)}};
  if (name == "vbgr") return {name, 1, 1, {stripes_down(kThird, kSecond, kFirst)}};
  throw input_error("subpixel layout '{}': not a known name", name)
      .remedy("use rgb, bgr, vrgb, vbgr or a table of cells");
}

SubpixelLayout SubpixelLayout::cells(int columns, int rows, std::vector<PixelCell> cells) {
  if (columns < 1 || rows < 1 || columns > kMaxCellsPerSide || rows > kMaxCellsPerSide)
    throw Error(ErrorKind::Input, "subpixel layout: columns and rows must be 1 to 64");
  const size_t expected = static_cast<size_t>(columns) * static_cast<size_t>(rows);
  if (cells.size() != expected) {
    throw input_error("subpixel layout: {} cells where columns * rows = {}", cells.size(),
                      expected);
  }
  for (const PixelCell& cell : cells) {
    for (const SubpixelOffset& offset : cell)
      if (!is_sane(offset))
        throw Error(ErrorKind::Input, "subpixel layout: an offset is not within -2 to 2 pixels");
  }
  return {"cells", columns, rows, std::move(cells)};
}

}  // namespace lenticule::optics
