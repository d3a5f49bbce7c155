// SPDX-License-Identifier: Apache-2.0
// TileOptics approximates the subpixel-to-ray map over a small tile of the panel with short
// polynomials. It serves callers that make rays for sixteen rows at a time and have about a
// nanosecond per ray. The approximation error is measured when a rig is prepared; where the error
// would matter, the caller evaluates the exact map.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "optics/model.h"

namespace lenticule::render {

/// TileOptics expands tiles of one rig. A tile is sixteen rows high. Column c of the tile is, in
/// row r, subpixel column_begin + c - shifts[r]: a column follows a slanted lens from row to row.
/// Immutable after construction.
///
/// Thread safety: any thread.
class TileOptics {
 public:
  static constexpr int kRows = 16;
  static constexpr int kMostCoefficients = 8;  ///< limit for the tangent polynomials
  static constexpr int kShiftCoefficients = 4;

  /// Constants holds what is the same for all tiles of a rig.
  struct Constants {
    int columns = 0;             ///< width of a tile
    int coefficients = 2;        ///< number of tangent[n] in use; the others are not set
    bool colours_alike = false;  ///< all colours have equal arrays
    double phase_error = 0.0;    ///< lenses
    double lens_step = 0.0;
    double x_step_mm = 0.0;
  };

  /// Tile holds arrays over the rows of a tile and, where colours differ, over the colour that a
  /// column has in row 0, (column_begin + c) mod 3. For column c:
  ///   phase    = phase[0] + c (phase[1] + c phase[2]), within phase_error;
  ///   lens     = the integer nearest to the phase; near a border, call exact_off();
  ///   argument = bend[0] + c (bend[1] + c bend[2]) - lens_step (phase - lens);
  ///   tan_x    = sum of tangent[n] argument^n;
  ///   lens_x   = x0_mm + x_step_mm c + sum of shift_mm[n] argument^n.
  struct Tile {
    using Rows = std::array<double, kRows>;
    using FloatRows = std::array<float, kRows>;
    alignas(64) std::array<std::array<Rows, 3>, 3> phase;
    alignas(64) std::array<std::array<FloatRows, 3>, 3> bend;
    alignas(64) std::array<FloatRows, kMostCoefficients> tangent;
    alignas(64) std::array<FloatRows, kShiftCoefficients> shift_mm;
    std::array<Rows, 3> x0_mm;
    Rows lens_y_mm, tan_y;
    int row_begin = 0;
    int column_begin = 0;
  };

  /// Returns null if the map is not smooth enough across a tile (a residual map) or the subpixels
  /// of a pixel do not lie side by side. `columns` is the width of a tile.
  [[nodiscard]] static std::unique_ptr<TileOptics> make(const optics::OpticalModel& model,
                                                        int columns,
                                                        std::span<const int, kRows> shifts);
  /// Makes the first of these widths that make() accepts, or returns null. Large pixels bend the
  /// phase more along a tile; narrower tiles cost more time, but far less than the exact map.
  [[nodiscard]] static std::unique_ptr<TileOptics> make_first(const optics::OpticalModel& model,
                                                              std::span<const int> widths,
                                                              std::span<const int, kRows> shifts);
  ~TileOptics();

  [[nodiscard]] const Constants& constants() const;

  /// Expands any tile that touches the panel. Returns false if the polynomials do not cover the
  /// tile; `out` is unspecified then.
  [[nodiscard]] bool expand(int row_begin, int column_begin, Tile& out) const;

  /// Returns the distance between the phase of one subpixel of a tile and its lens, from the exact
  /// map.
  [[nodiscard]] double exact_off(const Tile& tile, int column, int row) const;

 private:
  struct Impl;
  explicit TileOptics(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::render
