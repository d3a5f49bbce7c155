// SPDX-License-Identifier: Apache-2.0
// Mounting says how the picture that a graphics card sends is turned when a viewer sees it: a
// portrait panel, a panel hung upside down, a panel behind a mirror.
#pragma once

#include <string>
#include <string_view>

namespace lenticule::optics {

/// PixelPlace is a pixel: column, and row from the top.
struct PixelPlace {
  int column = 0;
  int row = 0;
  friend bool operator==(const PixelPlace&, const PixelPlace&) = default;
};

/// PixelGrid is the size of a picture in pixels.
struct PixelGrid {
  int width = 0;
  int height = 0;
  friend bool operator==(const PixelGrid&, const PixelGrid&) = default;
};

/// Mounting turns sent pixels (column from the left, row from the top of the picture that the card
/// sends) into seen pixels: the two are swapped first, if at all, and then counted from the other
/// end, if at all. This covers the four turns of the picture and of its mirror image.
struct Mounting {
  bool swapped = false;           ///< the sent rows are seen as columns
  bool reversed_columns = false;  ///< seen columns are counted from the other end
  bool reversed_rows = false;     ///< seen rows are counted from the other end

  /// Returns true if the viewer sees the picture as it is sent.
  [[nodiscard]] bool upright() const { return *this == Mounting{}; }
  /// Returns the size of the seen picture for a sent picture, and the other way round.
  [[nodiscard]] PixelGrid turned(PixelGrid size) const {
    return swapped ? PixelGrid{size.height, size.width} : size;
  }
  /// Returns the seen pixel that shows pixel `sent`; `seen` is the size of the seen picture.
  [[nodiscard]] PixelPlace seen_place(PixelPlace sent, PixelGrid seen) const;
  /// Returns the mounting that undoes this one.
  [[nodiscard]] Mounting inverse() const;
  friend bool operator==(const Mounting&, const Mounting&) = default;
};

/// Returns the mounting that turns by `first` and then by `second`.
[[nodiscard]] Mounting combined(const Mounting& first, const Mounting& second);

/// Returns the mounting "0", "90", "180", "270" (the viewer sees the picture turned clockwise by so
/// many degrees) or "mirrored", "mirrored 90", ... (mirrored left to right, then turned). Throws
/// Error(Input) "mounting 'NAME': ..." for other names.
[[nodiscard]] Mounting mounting_named(std::string_view name);
[[nodiscard]] std::string mounting_name(const Mounting& mounting);

}  // namespace lenticule::optics
