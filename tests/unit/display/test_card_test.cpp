// SPDX-License-Identifier: Apache-2.0
// Tests test cards by reading them back from their pixels, dot by dot.
#include "display/test_card.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>

#include "frames/text.h"

namespace lenticule::display {
namespace {

using frames::FrameGeometry;
using frames::Glyph;
using frames::glyph_of;
using frames::kCellWidth;
using frames::kGlyphHeight;
using frames::kGlyphWidth;
using frames::WovenFrame;
using testing::HasSubstr;

CardText wrong_panel() {
  return {.headline = "WRONG PANEL",
          .rows = {{"expected", "LGD 0x1234 serial 0O1Il, 3840x2160"},
                   {"found", "HDMI-A-1: DEL 0xa0b1 serial 'Qq{[' 'U2720Q', 2560x1440@59.951"},
                   {"do",
                    "connect the expected panel, or give this one a rig of its own: lenticule "
                    "panels, then /etc/lenticule/a-rather-long-name-of-a-lobby.toml"}}};
}

uint32_t pixel(const WovenFrame& frame, int x, int y) {
  const uint8_t* p = frame.row(y) + 3 * static_cast<ptrdiff_t>(x);
  return uint32_t{p[0]} << 16 | uint32_t{p[1]} << 8 | p[2];
}

/// Returns true if the whole dot is white, false if it is black, nothing if it is mixed.
std::optional<bool> dot(const WovenFrame& frame, int x, int y, int scale) {
  const uint32_t first = pixel(frame, x, y);
  if (first != 0 && first != 0xffffff) return std::nullopt;
  for (int j = 0; j < scale; ++j)
    for (int i = 0; i < scale; ++i)
      if (pixel(frame, x + i, y + j) != first) return std::nullopt;
  return first != 0;
}

/// Returns the character whose every dot matches; '\0' if none does.
char read_character(const WovenFrame& frame, int x, int y, int scale) {
  Glyph seen{};
  for (int row = 0; row < kGlyphHeight; ++row)
    for (int column = 0; column < kGlyphWidth; ++column) {
      const auto lit = dot(frame, x + column * scale, y + row * scale, scale);
      if (!lit) return '\0';
      if (*lit) seen.at(static_cast<size_t>(row)) |= static_cast<uint8_t>(1 << (4 - column));
    }
  for (char c = ' '; c <= '~'; ++c)
    if (glyph_of(c) == seen) return c;
  return '\0';
}

/// Returns all text of a card as read from its pixels.
std::string read_card(const WovenFrame& frame, const CardLayout& layout) {
  std::string all;
  for (const PlacedText& placed : layout.texts) {
    for (size_t i = 0; i < placed.text.size(); ++i) {
      const int x = placed.x + static_cast<int>(i) * kCellWidth * placed.scale;
      const bool inside = x + kGlyphWidth * placed.scale <= frame.width() &&
                          placed.y + kGlyphHeight * placed.scale <= frame.height();
      if (!inside) return all + "<beyond the frame>";
      all += read_character(frame, x, placed.y, placed.scale);
    }
    all += ' ';
  }
  return all;
}

/// Returns `text` without spaces and line breaks.
std::string without_spaces(const std::string& text) {
  std::string result;
  for (const char c : text)
    if (c != ' ') result += c;
  return result;
}

class TestCardSize : public testing::TestWithParam<FrameGeometry> {
 protected:
  /// Returns the card of this size, which is drawn once for all tests.
  static const WovenFrame& card() {
    static std::map<int, WovenFrame> cards;
    const int width = GetParam().width;  // no two sizes share it
    if (!cards.contains(width)) cards.emplace(width, draw_test_card(GetParam(), wrong_panel()));
    return cards.at(width);
  }
};

TEST_P(TestCardSize, EveryWordIsLegible) {
  const CardText text = wrong_panel();
  const WovenFrame& frame = card();
  const CardLayout layout = lay_out_card(GetParam(), text);
  const std::string read = without_spaces(read_card(frame, layout));
  EXPECT_THAT(read, HasSubstr(without_spaces(text.headline)));
  for (const CardText::Row& row : text.rows) {
    EXPECT_THAT(read, HasSubstr(row.label));
    EXPECT_THAT(read, HasSubstr(without_spaces(row.text)));
  }
  EXPECT_THAT(read, HasSubstr("CHROMA"));
  // Letters have at least a fiftieth of the shorter side, which is legible across a lobby.
  EXPECT_GE(7 * 50 * layout.scale, std::min(GetParam().width, GetParam().height));
}

TEST_P(TestCardSize, TheOutermostPixelsAreAWhiteLine) {
  const WovenFrame& frame = card();
  const int w = frame.width();
  const int h = frame.height();
  for (int x = 0; x < w; ++x) {
    EXPECT_EQ(pixel(frame, x, 0), 0xffffffU);
    EXPECT_EQ(pixel(frame, x, h - 1), 0xffffffU);
  }
  for (int y = 0; y < h; ++y) {
    EXPECT_EQ(pixel(frame, 0, y), 0xffffffU);
    EXPECT_EQ(pixel(frame, w - 1, y), 0xffffffU);
  }
  EXPECT_EQ(pixel(frame, w / 2, 1), 0U) << "one pixel wide";
  EXPECT_EQ(pixel(frame, 1, h / 2), 0U) << "one pixel wide";
}

TEST_P(TestCardSize, CornersRevealRotatedAndMirroredPictures) {
  const WovenFrame& frame = card();
  EXPECT_EQ(pixel(frame, 4, 4), 0xff0000U);
  EXPECT_EQ(pixel(frame, frame.width() - 5, 4), 0x00ff00U);
  EXPECT_EQ(pixel(frame, 4, frame.height() - 5), 0x0000ffU);
  EXPECT_EQ(pixel(frame, frame.width() - 5, frame.height() - 5), 0xffffffU);
}

TEST_P(TestCardSize, ScalingWouldBlurOnePixelLines) {
  const WovenFrame& frame = card();
  const auto patches = lay_out_card(GetParam(), wrong_panel()).patches;
  ASSERT_TRUE(patches);
  const CardBox& box = patches->lines;
  const int third = box.width / 3;
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + third - 1; ++x)
      EXPECT_EQ(pixel(frame, x, y) ^ pixel(frame, x + 1, y), 0xffffffU) << "columns";
    for (int x = box.x + third; x < box.x + 2 * third - 1; ++x)
      EXPECT_EQ(pixel(frame, x, y), pixel(frame, x + 1, y)) << "rows";
    if (y > box.y) {
      EXPECT_EQ(pixel(frame, box.x + third, y) ^ pixel(frame, box.x + third, y - 1), 0xffffffU);
      const int corner = box.x + 2 * third;
      EXPECT_EQ(pixel(frame, corner, y) ^ pixel(frame, corner, y - 1), 0xffffffU) << "squares";
      EXPECT_EQ(pixel(frame, corner, y) ^ pixel(frame, corner + 1, y), 0xffffffU) << "squares";
    }
  }
}

TEST_P(TestCardSize, SubsampledChromaWouldEqualizeBothHalves) {
  const WovenFrame& frame = card();
  const auto patches = lay_out_card(GetParam(), wrong_panel()).patches;
  ASSERT_TRUE(patches);
  const CardBox& box = patches->chroma;
  const int y = box.y + box.height / 2;
  for (int x = box.x; x < box.x + box.width / 2; ++x)
    EXPECT_EQ(pixel(frame, x, y), x % 2 == 0 ? 0xff0000U : 0x0000ffU);
  EXPECT_EQ(pixel(frame, box.x + box.width - 1, y), 0x800080U);
}

TEST_P(TestCardSize, ALimitedRangeWouldMergeDarkAndLightSteps) {
  const WovenFrame& frame = card();
  const auto patches = lay_out_card(GetParam(), wrong_panel()).patches;
  ASSERT_TRUE(patches);
  const int each = patches->dark.width / kCardSteps;
  for (int i = 0; i < kCardSteps; ++i) {
    EXPECT_EQ(frame.row(patches->dark.y + 1)[3 * (patches->dark.x + i * each + each / 2)],
              dark_step(i));
    EXPECT_EQ(frame.row(patches->light.y + 1)[3 * (patches->light.x + i * each + each / 2)],
              light_step(i));
  }
  EXPECT_EQ(light_step(kCardSteps - 1), 255);
}

INSTANTIATE_TEST_SUITE_P(Panels, TestCardSize,
                         testing::Values(FrameGeometry{640, 480}, FrameGeometry{1024, 768},
                                         FrameGeometry{1920, 1080}, FrameGeometry{1080, 1920},
                                         FrameGeometry{1536, 2048}, FrameGeometry{3840, 2160},
                                         FrameGeometry{7680, 4320}),
                         [](const auto& panel) {
                           return std::to_string(panel.param.width) + "x" +
                                  std::to_string(panel.param.height);
                         });

TEST(TestCard, FitsFramesOfAnySizeAndIsDeterministic) {
  for (const int width : {1, 2, 3, 5, 17, 64, 199, 321, 800})
    for (const int height : {1, 2, 3, 7, 31, 100, 241, 600}) {
      const FrameGeometry geometry{width, height};
      const WovenFrame frame = draw_test_card(geometry, wrong_panel());
      EXPECT_EQ(frame.geometry(), geometry);
      EXPECT_EQ(pixel(frame, 0, 0), 0xffffffU);
      EXPECT_EQ(frame, draw_test_card(geometry, wrong_panel()));
    }
}

TEST(TestCard, PrefersTheHeadlineIfSpaceIsShort) {
  const FrameGeometry small{160, 60};
  const CardLayout layout = lay_out_card(small, wrong_panel());
  EXPECT_FALSE(layout.patches);
  EXPECT_THAT(read_card(draw_test_card(small, wrong_panel()), layout), HasSubstr("WRONG"));
}

TEST(TestCard, ToleratesAnyTextFromAPanel) {
  CardText text{
      .headline = std::string(5000, 'W'),
      .rows = {
          {std::string(300, 'x'), std::string(5000, 'y')}, {"", ""}, {"\x01\xff", "\n\t\x7f"}}};
  for (int i = 0; i < 200; ++i) text.rows.push_back({"row", "text"});
  EXPECT_EQ(draw_test_card({640, 480}, text).width(), 640);
  EXPECT_EQ(draw_test_card({1, 1}, {}).width(), 1);
}

}  // namespace
}  // namespace lenticule::display
