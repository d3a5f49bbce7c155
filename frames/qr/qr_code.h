// SPDX-License-Identifier: Apache-2.0
// QrCode is the QR code of a text, for the panel and for a terminal.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

/// Modules of the light border that scanners need on each side.
inline constexpr int kQrBorder = 4;

struct QrCode {
  int side = 0;                 ///< modules per side, without the border
  std::vector<uint8_t> dark{};  ///< rows from the top; 1 = dark

  /// Returns false outside of the code.
  [[nodiscard]] bool is_dark(int x, int y) const {
    return x >= 0 && x < side && y >= 0 && y < side &&
           dark[static_cast<size_t>(y) * static_cast<size_t>(side) + static_cast<size_t>(x)] != 0;
  }
};

/// Returns the code of 1 to 500 bytes, with error correction of level M. Throws Error(Usage).
[[nodiscard]] QrCode qr_code_of(const std::string& text);

/// QrPlace is the square of the code, with its border, in a frame.
struct QrPlace {
  int left = 0, top = 0;
  int module_px = 0;  ///< side of a module
};
/// Returns the largest place in the middle of the panel. Throws Error(Input) if the code has more
/// modules than the panel has pixels.
[[nodiscard]] QrPlace place_qr_code(const QrCode& code, const FrameGeometry& panel);

/// Returns the code on a black panel. It has no parallax: every view shows it in the plane of the
/// panel, so that each eye reads it through the lenses. A module is many lenses wide.
[[nodiscard]] WovenFrame draw_qr_code(const QrCode& code, const FrameGeometry& panel);

/// Returns lines for a terminal, two rows of modules each, in colours that do not depend on those
/// of the terminal.
[[nodiscard]] std::string qr_terminal_text(const QrCode& code);

}  // namespace lenticule::frames
