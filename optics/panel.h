// SPDX-License-Identifier: Apache-2.0
// Panel describes the LCD: number and size of the pixels, and the positions of the three subpixels
// inside a pixel. Mounting says how the picture that a graphics card sends is turned when a viewer
// sees it: a portrait panel, a panel hung upside down, a panel behind a mirror.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "optics/units.h"
#include "optics/vec.h"

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

/// SubpixelOffset is the centre of a subpixel inside its pixel, in pixels; (0, 0) is the pixel's
/// top-left corner.
struct SubpixelOffset {
  double x_px = 0.5;
  double y_px = 0.5;
  friend bool operator==(const SubpixelOffset&, const SubpixelOffset&) = default;
};

/// PixelCell holds the offsets of R, G, B in one pixel.
using PixelCell = std::array<SubpixelOffset, 3>;

/// SubpixelLayout is a table of cells that repeats over the panel: 1x1 for stripes, a few pixels
/// for "cell" panels.
class SubpixelLayout {
 public:
  /// Makes RGB stripes from left to right, the common LCD layout.
  SubpixelLayout();
  static SubpixelLayout rgb();
  static SubpixelLayout bgr();
  /// Returns stripes from top to bottom (a panel rotated by 90 degrees).
  static SubpixelLayout vrgb();
  static SubpixelLayout vbgr();
  /// Returns a layout with cells[row * columns + column]. The cell of pixel (i, j) is (i mod
  /// columns, j mod rows), j downward. Throws Error(Input) unless 1 <= columns, rows <= 64 and
  /// every offset is finite and in [-2, 2].
  static SubpixelLayout cells(int columns, int rows, std::vector<PixelCell> cells);
  /// Returns the layout "rgb", "bgr", "vrgb" or "vbgr". Throws Error(Input) for other names.
  static SubpixelLayout named(const std::string& name);

  [[nodiscard]] const SubpixelOffset& offset(int i, int j, int channel) const {
    return cells_[static_cast<size_t>((j % rows_) * columns_ + i % columns_)]
                 [static_cast<size_t>(channel)];
  }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] const std::vector<PixelCell>& table() const { return cells_; }
  /// Returns one of the four names, or "cells".
  [[nodiscard]] const std::string& name() const { return name_; }
  friend bool operator==(const SubpixelLayout&, const SubpixelLayout&) = default;

 private:
  SubpixelLayout(std::string name, int columns, int rows, std::vector<PixelCell> cells);

  std::string name_;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<PixelCell> cells_;
};

/// Bits per colour of panels.
inline constexpr int kUsualBits = 8;
inline constexpr int kDeepBits = 10;

/// Panel holds the pixel grid as the viewer sees it. Pixel (i, j): i right, j down. The panel frame
/// is in millimetres, x right, y up, z toward the viewer, with its origin at the panel centre on
/// the plane of the lens apices.
struct Panel {
  int width_px = 0;
  int height_px = 0;
  Millimetres pixel_width{0};   ///< a_x
  Millimetres pixel_height{0};  ///< a_y
  SubpixelLayout layout;
  Mounting mounting = {};  ///< from the picture that the graphics card sends to this grid
  int bits = kUsualBits;   ///< bits per colour of the panel and its link: these or kDeepBits

  /// Returns the size of the picture that the graphics card sends.
  [[nodiscard]] PixelGrid sent_size() const { return mounting.turned({width_px, height_px}); }

  /// Returns the panel point, in pixels (X, Y), of the centre of subpixel `channel` of pixel (i,
  /// j).
  [[nodiscard]] Vec2 subpixel_centre_px(int i, int j, int channel) const {
    const SubpixelOffset& o = layout.offset(i, j, channel);
    return {i + o.x_px, j + o.y_px};
  }
  [[nodiscard]] double x_mm(double x_px) const {
    return pixel_width.value * (x_px - width_px / 2.0);
  }
  [[nodiscard]] double y_mm(double y_px) const {
    return pixel_height.value * (height_px / 2.0 - y_px);
  }
  [[nodiscard]] double x_px(double x_mm) const { return x_mm / pixel_width.value + width_px / 2.0; }
  [[nodiscard]] double y_px(double y_mm) const {
    return height_px / 2.0 - y_mm / pixel_height.value;
  }
  friend bool operator==(const Panel&, const Panel&) = default;
};

}  // namespace lenticule::optics
