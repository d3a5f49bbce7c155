// SPDX-License-Identifier: Apache-2.0
// A small bitmap font for test cards: printable ASCII, made for being told apart (0 and O, 1, I and
// l) rather than for beauty, since serial numbers are read from it.
#pragma once

#include <array>
#include <cstdint>

namespace lenticule::frames {

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 9;  ///< with descenders; capitals take the upper seven
inline constexpr int kCellWidth = 6;
inline constexpr int kCellHeight = 10;

/// Rows from the top; bit 4 is the leftmost pixel.
using Glyph = std::array<uint8_t, kGlyphHeight>;

/// What is no printable ASCII character is an empty box.
[[nodiscard]] Glyph glyph_of(char character);

}  // namespace lenticule::frames
