// SPDX-License-Identifier: Apache-2.0
#include "frames/text.h"

#include <algorithm>

#include "frames/bitmap_font.h"

namespace lenticule::frames {

void set_pixel(WovenFrame& frame, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= frame.width() || y >= frame.height()) return;
  std::copy(colour.begin(), colour.end(), frame.row(y) + 3 * static_cast<ptrdiff_t>(x));
}

void fill_box(WovenFrame& frame, const PixelBox& box, const Colour& colour) {
  const int right = std::min(box.x + box.width, frame.width());
  const int bottom = std::min(box.y + box.height, frame.height());
  for (int y = std::max(box.y, 0); y < bottom; ++y)
    for (int x = std::max(box.x, 0); x < right; ++x) set_pixel(frame, x, y, colour);
}

void draw_text(WovenFrame& frame, int x, int y, int scale, std::string_view text,
               const Colour& colour) {
  for (const char character : text) {
    const Glyph glyph = glyph_of(character);
    for (int row = 0; row < kGlyphHeight; ++row)
      for (int column = 0; column < kGlyphWidth; ++column)
        if ((glyph.at(static_cast<size_t>(row)) >> (kGlyphWidth - 1 - column) & 1) != 0)
          fill_box(frame, {x + column * scale, y + row * scale, scale, scale}, colour);
    x += kCellWidth * scale;
  }
}

std::vector<std::string> wrap_text(std::string_view text, size_t columns) {
  std::vector<std::string> lines(1);
  while (!text.empty()) {
    const size_t end = std::min(text.find(' '), text.size());
    std::string_view word = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    std::string& line = lines.back();
    const size_t wanted = line.empty() ? word.size() : line.size() + 1 + word.size();
    if (wanted <= columns) {
      if (!line.empty()) line += ' ';
      line += word;
      continue;
    }
    if (!line.empty()) lines.emplace_back();
    for (; word.size() > columns; word.remove_prefix(columns)) {
      lines.back() = word.substr(0, columns);
      lines.emplace_back();
    }
    lines.back() = word;
  }
  return lines;
}

}  // namespace lenticule::frames
