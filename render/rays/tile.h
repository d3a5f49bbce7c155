// SPDX-License-Identifier: Apache-2.0
// Division of a frame into tiles, the units of work.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "optics/rig.h"

namespace lenticule::render {

/// Tile is a band of rows and a range of sheared columns. A column follows the slanted lens from
/// row to row, along one elemental image, so that its rays share lens and view.
struct Tile {
  int row_begin = 0;
  int rows = 0;
  int column_begin = 0;  ///< sheared: subpixel in the tile's first row
  int columns = 0;
};

/// Column range [begin, end) of a tile.
struct ColumnRange {
  int begin = 0;
  int end = 0;
};

/// BeamSize is the size of the part of a scene that one subpixel stands for: the distance to what
/// its neighbours show, in the panel frame. `z` is in millimetres before the panel.
struct BeamSize {
  double lens_mm = 0.0;            ///< width of a lens along a row
  double row_mm = 0.0;             ///< height of a row
  double subpixels_per_gap = 0.0;  ///< tangent of the angle between neighbouring views
  double inverse_distance = 0.0;   ///< of the viewing line

  /// Returns the distance between neighbouring lenses, or between neighbouring views where those
  /// are farther apart.
  [[nodiscard]] double across_mm(double z) const {
    return std::max(lens_mm * closer(z), subpixels_per_gap * std::abs(z));
  }
  [[nodiscard]] double along_mm(double z) const { return row_mm * closer(z); }

 private:
  [[nodiscard]] double closer(double z) const { return std::abs(1.0 - z * inverse_distance); }
};

class TilePlan {
 public:
  static constexpr int kRows = 16;      ///< one packet
  static constexpr int kColumns = 384;  ///< subpixels

  explicit TilePlan(const optics::Rig& rig);

  [[nodiscard]] int count() const { return bands_ * per_band_; }
  /// Returns the number of tiles in a band of kRows rows; tiles are numbered from left to right.
  [[nodiscard]] int per_band() const { return per_band_; }
  [[nodiscard]] Tile tile(int index) const;

  /// Returns the number of subpixels by which a column has moved to the left `row` rows below the
  /// tile's first row.
  [[nodiscard]] int shift(int row) const { return shifts_[static_cast<size_t>(row)]; }
  /// Returns the subpixel (3 i + channel) of a tile's column in one of its rows. It lies outside
  /// [0, row_subpixels()) if the shear leaves the panel.
  [[nodiscard]] int subpixel(const Tile& tile, int column, int row) const {
    return tile.column_begin + column - shift(row);
  }
  [[nodiscard]] int row_subpixels() const { return 3 * width_; }
  /// Returns the distance between two rows.
  [[nodiscard]] double row_mm() const { return beam_.row_mm; }
  [[nodiscard]] const BeamSize& beam() const { return beam_; }

 private:
  int width_;
  int height_;
  BeamSize beam_;
  std::array<int, kRows> shifts_{};
  int first_column_;
  int bands_;
  int per_band_;
};

}  // namespace lenticule::render
