// SPDX-License-Identifier: Apache-2.0
// The subpixel-to-ray map over a small piece of the panel as short polynomials, for whoever makes
// rays sixteen rows at a time and has a nanosecond for each. What they leave out is measured when a
// rig is prepared; where it would matter, the map itself has to be asked.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "optics/model.h"

namespace lenticule::optics {

/// A tile is sixteen rows high. Its column c is, in row r, subpixel column_begin + c - shifts[r]: a
/// column follows a slanted lens from row to row. Immutable after construction, safe from any
/// thread.
class TileOptics {
 public:
  static constexpr int kRows = 16;
  static constexpr int kMostCoefficients = 8;  ///< of tangents
  static constexpr int kShiftCoefficients = 4;

  /// Arrays over the rows of a tile, and over the colours that a column can have in row 0,
  /// (column_begin + c) mod 3, where they differ. Of column c:
  ///   phase    = phase[0] + c (phase[1] + c phase[2]), within phase_error();
  ///   lens     = the integer nearest to the phase; near a border, ask exact_off();
  ///   argument = bend[0] + c (bend[1] + c bend[2]) - lens_step() (phase - lens);
  ///   tan_x    = sum of tangent[n] argument^n;
  ///   lens_x   = x0_mm + x_step_mm() c + sum of shift_mm[n] argument^n.
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

  /// Null where the map is not smooth enough across a tile (a residual map) or the subpixels of a
  /// pixel do not lie side by side. `columns` is the width of a tile.
  [[nodiscard]] static std::unique_ptr<TileOptics> make(const OpticalModel& model, int columns,
                                                        std::span<const int, kRows> shifts);
  /// Of the first of these widths that make() takes: large pixels bend the phase more along a tile,
  /// and narrower tiles cost more, but far less than the map.
  [[nodiscard]] static std::unique_ptr<TileOptics> make_first(const OpticalModel& model,
                                                              std::span<const int> widths,
                                                              std::span<const int, kRows> shifts);
  ~TileOptics();

  [[nodiscard]] int columns() const;
  [[nodiscard]] double phase_error() const;  ///< lenses
  [[nodiscard]] double lens_step() const;
  [[nodiscard]] double x_step_mm() const;
  /// How many of kMostCoefficients are in use; the others are not set.
  [[nodiscard]] int coefficients() const;

  /// Any tile that touches the panel. False where the polynomials do not reach; `out` is
  /// unspecified then.
  [[nodiscard]] bool expand(int row_begin, int column_begin, Tile& out) const;

  /// How far the phase of one subpixel of a tile lies from its lens, as the map itself says.
  [[nodiscard]] double exact_off(const Tile& tile, int column, int row) const;

 private:
  struct Impl;
  explicit TileOptics(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::optics
