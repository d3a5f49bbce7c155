// SPDX-License-Identifier: Apache-2.0
// A test card that a player shows instead of 3-D frames: text on black, legible through any lens
// sheet, and patterns that reveal whether the link or the panel alters pixels.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/text.h"

namespace lenticule::display {

struct CardText {
  struct Row {
    std::string label;  ///< "expected"; may be empty
    std::string text;   ///< wrapped at the card's width
  };
  std::string headline;
  std::vector<Row> rows;
};

using CardBox = frames::PixelBox;

struct PlacedText {
  int x = 0;
  int y = 0;
  int scale = 1;  ///< pixels per dot of the font
  std::string text;
};

/// Positions of all parts. Small frames omit parts: first the patches, then the last lines.
struct CardLayout {
  int scale = 1;  ///< scale of the text
  std::vector<PlacedText> texts;
  struct Patches {
    CardBox lines;   ///< a third each: columns, rows and squares of one pixel, black and white
    CardBox chroma;  ///< left half: columns of one pixel, red and blue; right half: their mean
    CardBox dark;    ///< eight steps from 0 to 28
    CardBox light;   ///< eight steps from 227 to 255
  };
  std::optional<Patches> patches;
};

inline constexpr int kCardSteps = 8;
[[nodiscard]] constexpr int dark_step(int i) { return 4 * i; }
[[nodiscard]] constexpr int light_step(int i) { return 227 + 4 * i; }

[[nodiscard]] CardLayout lay_out_card(const frames::FrameGeometry& geometry, const CardText& text);

/// Draws the card for a frame of any size. Its outermost pixels are a white line, one pixel wide.
[[nodiscard]] frames::WovenFrame draw_test_card(const frames::FrameGeometry& geometry,
                                                const CardText& text);

}  // namespace lenticule::display
