// SPDX-License-Identifier: Apache-2.0
// Division of a frame into tiles, the units of work.
#pragma once

#include <array>

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
  [[nodiscard]] double row_mm() const { return row_mm_; }

 private:
  int width_;
  int height_;
  double row_mm_;
  std::array<int, kRows> shifts_{};
  int first_column_;
  int bands_;
  int per_band_;
};

}  // namespace lenticule::render
