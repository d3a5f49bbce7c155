// SPDX-License-Identifier: Apache-2.0
// Plain words and boxes drawn into a frame, pixel for pixel: for pictures that are legible without
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

using Colour = std::array<uint8_t, 3>;  ///< R, G, B code values

/// In pixels from the top left; may reach beyond the frame, which nothing is drawn outside of.
struct PixelBox {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

/// Frames are Rgb8 throughout. Safe from any thread, one per frame.
void set_pixel(WovenFrame& frame, int x, int y, const Colour& colour);
void fill_box(WovenFrame& frame, const PixelBox& box, const Colour& colour);

/// One line, its top left at (x, y), every dot of the font `scale` pixels wide and high. The ground
/// stays as it is.
void draw_text(WovenFrame& frame, int x, int y, int scale, std::string_view text,
               const Colour& colour);

/// Broken at spaces; a word that is longer than `columns` (at least 1) is broken anywhere. At least
/// one line.
[[nodiscard]] std::vector<std::string> wrap_text(std::string_view text, size_t columns);

}  // namespace lenticule::frames
