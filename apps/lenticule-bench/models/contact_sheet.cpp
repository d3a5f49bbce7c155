// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/models/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "frames/bitmap_font.h"
#include "frames/srgb.h"
#include "frames/text.h"

namespace lenticule::bench {
namespace {

constexpr int kGap = 8;
constexpr int kTextScale = 2;
constexpr int kCaption = kTextScale * frames::kCellHeight + 6;
constexpr uint8_t kPaper = 48;
constexpr frames::Colour kInk{230, 230, 230};

/// Colours of the map at equal distances from 0 to 1.
constexpr std::array<frames::Colour, 5> kMapColours{
    {{0, 0, 4}, {81, 18, 124}, {183, 55, 121}, {252, 137, 97}, {252, 253, 191}}};

void put(const frames::WovenFrame& pane, int x, int y, frames::WovenFrame& sheet) {
  for (int j = 0; j < pane.height(); ++j)
    std::copy_n(pane.row(j), pane.geometry().row_bytes(), sheet.row(y + j) + 3 * x);
}

}  // namespace

frames::WovenFrame averaged(const frames::FrameView& picture, int factor) {
  if (factor < 1 || picture.geometry.width < factor || picture.geometry.height < factor)
    throw Error(ErrorKind::Usage, "a picture cannot be averaged over larger squares");
  const auto& light = frames::linear_of_codes();
  frames::WovenFrame result(
      {.width = picture.geometry.width / factor, .height = picture.geometry.height / factor});
  for (int j = 0; j < result.height(); ++j)
    for (int i = 0; i < result.width(); ++i)
      for (int c = 0; c < 3; ++c) {
        double sum = 0.0;
        for (int n = 0; n < factor; ++n)
          for (int m = 0; m < factor; ++m)
            sum += light[picture.row(factor * j + n)[3 * (factor * i + m) + c]];
        result.row(j)[3 * i + c] = frames::code_from_linear(sum / (factor * factor));
      }
  return result;
}

frames::WovenFrame flip_picture(const std::vector<float>& map, int width, int height) {
  LENTICULE_CHECK(map.size() == static_cast<size_t>(width) * static_cast<size_t>(height));
  frames::WovenFrame picture({.width = width, .height = height});
  constexpr int kSteps = static_cast<int>(kMapColours.size()) - 1;
  for (size_t n = 0; n < map.size(); ++n) {
    const double place = std::clamp(double{map[n]}, 0.0, 1.0) * kSteps;
    const int below = std::min(static_cast<int>(place), kSteps - 1);
    const frames::Colour& a = kMapColours[static_cast<size_t>(below)];
    const frames::Colour& b = kMapColours[static_cast<size_t>(below) + 1];
    for (size_t c = 0; c < 3; ++c)
      picture.bytes()[3 * n + c] =
          static_cast<uint8_t>(std::lround(a[c] + (place - below) * (b[c] - a[c])));
  }
  return picture;
}

frames::WovenFrame contact_sheet(const std::vector<ContactEntry>& entries, int pane_px) {
  const int columns = std::min(static_cast<int>(entries.size()), kSheetColumns);
  const int rows = (static_cast<int>(entries.size()) + kSheetColumns - 1) / kSheetColumns;
  const int entry_width = 3 * pane_px + 2 * kGap;
  frames::WovenFrame sheet({.width = columns * (entry_width + 3 * kGap) - 3 * kGap,
                            .height = rows * (pane_px + kCaption + kGap)});
  std::ranges::fill(sheet.bytes(), kPaper);
  for (size_t n = 0; n < entries.size(); ++n) {
    const int x = static_cast<int>(n) % kSheetColumns * (entry_width + 3 * kGap);
    const int y = static_cast<int>(n) / kSheetColumns * (pane_px + kCaption + kGap);
    const size_t room = static_cast<size_t>(entry_width / (kTextScale * frames::kCellWidth));
    frames::draw_text(sheet, x + 2, y + 3, kTextScale, entries[n].caption.substr(0, room), kInk);
    int left = x;
    for (const frames::WovenFrame* pane :
         {&entries[n].ours, &entries[n].theirs, &entries[n].flip}) {
      frames::fill_box(sheet, {left, y + kCaption, pane_px, pane_px}, {96, 96, 96});
      if (pane->width() == pane_px && pane->height() == pane_px)
        put(*pane, left, y + kCaption, sheet);
      left += pane_px + kGap;
    }
  }
  return sheet;
}

}  // namespace lenticule::bench
