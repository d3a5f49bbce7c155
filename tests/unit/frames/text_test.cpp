// SPDX-License-Identifier: Apache-2.0
// Tests text in frames: the font, the position of its dots, line breaks.
#include "frames/text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <set>

namespace lenticule::frames {
namespace {

using testing::ElementsAre;

constexpr Colour kWhite = {255, 255, 255};

int64_t light_of(const WovenFrame& frame) {
  return std::accumulate(frame.bytes().begin(), frame.bytes().end(), int64_t{0});
}

TEST(BitmapFont, NoTwoCharactersLookAlike) {
  std::set<Glyph> glyphs;
  for (char c = ' '; c <= '~'; ++c) EXPECT_TRUE(glyphs.insert(glyph_of(c)).second) << c;
  EXPECT_TRUE(glyphs.insert(glyph_of('\n')).second) << "what cannot be printed is a box";
  EXPECT_EQ(glyph_of('\xe4'), glyph_of('\n'));
  for (const Glyph& glyph : glyphs)
    for (const uint8_t row : glyph) EXPECT_LT(row, 32);
}

TEST(DrawText, EveryDotIsASquareOfItsScale) {
  constexpr int kScale = 3;
  WovenFrame frame({.width = 60, .height = 40});
  draw_text(frame, 4, 5, kScale, "Ag", kWhite);
  for (int i = 0; i < 2 * kCellWidth * kScale; ++i)
    for (int j = 0; j < kGlyphHeight * kScale; ++j) {
      const Glyph glyph = glyph_of(i < kCellWidth * kScale ? 'A' : 'g');
      const int column = i / kScale % kCellWidth;
      const bool lit = column < kGlyphWidth &&
                       (glyph.at(static_cast<size_t>(j / kScale)) >> (4 - column) & 1) != 0;
      EXPECT_EQ(frame.row(5 + j)[3 * (4 + i)], lit ? 255 : 0) << i << ' ' << j;
    }
}

TEST(DrawText, NothingIsDrawnBeyondTheFrame) {
  WovenFrame frame({.width = 16, .height = 12});
  draw_text(frame, -200, -100, 4, "####", kWhite);
  draw_text(frame, 16, 0, 4, "####", kWhite);
  EXPECT_EQ(light_of(frame), 0);
  fill_box(frame, {-5, -5, 1000, 1000}, kWhite);
  EXPECT_EQ(light_of(frame), int64_t{16} * 12 * 3 * 255);
}

TEST(WrapText, BreaksAtSpacesAndLongWordsAnywhere) {
  EXPECT_THAT(wrap_text("one two three", 7), ElementsAre("one two", "three"));
  EXPECT_THAT(wrap_text("a abcdefgh b", 3), ElementsAre("a", "abc", "def", "gh", "b"));
  EXPECT_THAT(wrap_text("", 5), ElementsAre(""));
}

}  // namespace
}  // namespace lenticule::frames
