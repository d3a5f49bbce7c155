// SPDX-License-Identifier: Apache-2.0
// A small bitmap font for test patterns: printable ASCII. The glyphs are designed to be easy to
// distinguish (0 and O, 1, I and l), because people read serial numbers from the panel.
#pragma once

#include <array>
#include <cstdint>

namespace lenticule::frames {

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 9;  ///< includes descenders; capitals use the upper seven rows
inline constexpr int kCellWidth = 6;
inline constexpr int kCellHeight = 10;

/// Glyph holds the rows from the top; bit 4 is the leftmost pixel.
using Glyph = std::array<uint8_t, kGlyphHeight>;

/// Returns the glyph of a character; an empty box for any character outside printable ASCII.
[[nodiscard]] Glyph glyph_of(char character);

}  // namespace lenticule::frames
