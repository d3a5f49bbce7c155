// SPDX-License-Identifier: Apache-2.0
// Draws plain text and boxes into a frame, pixel for pixel, for pictures that are legible without
// glasses and through any lens sheet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

// A small bitmap font for test patterns: printable ASCII. The glyphs are designed to be easy to
// distinguish (0 and O, 1, I and l), because people read serial numbers from the panel.

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 9;  ///< includes descenders; capitals use the upper seven rows
inline constexpr int kCellWidth = 6;
inline constexpr int kCellHeight = 10;

/// Glyph holds the rows from the top; bit 4 is the leftmost pixel.
using Glyph = std::array<uint8_t, kGlyphHeight>;

/// Returns the glyph of a character; an empty box for any character outside printable ASCII.
[[nodiscard]] Glyph glyph_of(char character);

using Colour = std::array<uint8_t, 3>;  ///< R, G, B code values

/// PixelBox is in pixels from the top left; it may extend beyond the frame, and drawing is clipped
/// to the frame.
struct PixelBox {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

/// Draw into an Rgb8 frame.
///
/// Thread safety: any thread; one thread per frame at a time.
void set_pixel(WovenFrame& frame, int x, int y, const Colour& colour);
void fill_box(WovenFrame& frame, const PixelBox& box, const Colour& colour);

/// Draws one line of text with its top left at (x, y); every dot of the font is `scale` pixels wide
/// and high. The background stays unchanged.
void draw_text(WovenFrame& frame, int x, int y, int scale, std::string_view text,
               const Colour& colour);

/// Breaks the text at spaces; a word longer than `columns` (at least 1) is broken anywhere. Returns
/// at least one line.
[[nodiscard]] std::vector<std::string> wrap_text(std::string_view text, size_t columns);

}  // namespace lenticule::frames
