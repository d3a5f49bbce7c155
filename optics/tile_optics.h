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
  static constexpr int kMostCoefficients = 8;

  /// Arrays over the rows r of a tile. With colour = (column_begin + c) mod 3 and c' = c +
  /// column_nudge[colour][r]:
  ///   phase    = phase0 + c' (phase1 + c' phase2) + phase_nudge[colour], within phase_error();
  ///   lens     = the lens of that phase (split_phase); near a border, ask exact_lens();
  ///   argument = lens_step lens - (argument0 + argument_step c + argument_nudge[colour]);
  ///   tan_x    = sum of tangent[n] argument^n;
  ///   lens_x   = x0_mm + x_step_mm c + x_nudge_mm[colour] + sum of shift_mm[n] argument^n.
  struct Tile {
    alignas(64) std::array<double, kRows> phase0, phase1, phase2;
    alignas(64) std::array<double, kRows> argument0;
    alignas(64) std::array<double, kRows> x0_mm, lens_y_mm, tan_y;
    alignas(64) std::array<std::array<float, kRows>, kMostCoefficients> tangent, shift_mm;
    int row_begin = 0;
    int column_begin = 0;
  };

  /// The same for all tiles of a rig.
  struct Constants {
    alignas(64) std::array<std::array<double, kRows>, 3> column_nudge, phase_nudge, argument_nudge;
    alignas(64) std::array<std::array<float, kRows>, 3> x_nudge_mm;
    double lens_step = 0.0;
    double argument_step = 0.0;
    double x_step_mm = 0.0;
    double phase_error = 0.0;  ///< of Tile's phase, in lenses
    int coefficients = 2;      ///< in use of kMostCoefficients
  };

  /// Null where the map is not smooth enough across a tile (a residual map) or the subpixels of a
  /// pixel do not lie side by side. `columns` is the width of a tile.
  [[nodiscard]] static std::unique_ptr<TileOptics> make(const OpticalModel& model, int columns,
                                                        std::span<const int, kRows> shifts);
  ~TileOptics();

  [[nodiscard]] const Constants& constants() const;

  /// Any tile that touches the panel. False where the polynomials do not reach; `out` is
  /// unspecified then.
  [[nodiscard]] bool expand(int row_begin, int column_begin, Tile& out) const;

  /// The lens of one subpixel of a tile as the map itself says.
  [[nodiscard]] double exact_lens(const Tile& tile, int column, int row) const;

 private:
  struct Impl;
  explicit TileOptics(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::optics
