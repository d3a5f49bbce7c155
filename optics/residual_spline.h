// SPDX-License-Identifier: Apache-2.0
// ResidualSpline evaluates a residual map: one bicubic polynomial per cell of the map's grid.
#pragma once

#include <vector>

#include "optics/rig.h"

namespace lenticule::optics {

/// ResidualSpline is a bicubic Catmull-Rom spline through the knots of a ResidualMap. The knots
/// beyond the border extrapolate the last two knots in a straight line, so that the map is linear
/// outside the panel and smooth (C1) everywhere. Immutable.
class ResidualSpline {
 public:
  struct Value {
    double lenses = 0.0;
    double per_px_x = 0.0;  ///< derivative to the right, lenses per pixel
  };

  ResidualSpline() = default;
  ResidualSpline(const ResidualMap& map, int width_px, int height_px);

  [[nodiscard]] bool empty() const { return coefficients_.empty(); }
  /// Returns the value at panel point (X, Y) in pixels, on or off the panel.
  [[nodiscard]] Value at(double x_px, double y_px) const;

  // The functions below serve evaluation of many points at a time. Cell (c, r) covers the grid
  // coordinates [c, c+1) x [r, r+1), c = X knots_per_px_x; c runs from -1 to columns - 1. The 16
  // coefficients of a cell are those of t^q u^p at index 4 p + q, with t, u the coordinates inside
  // the cell.
  [[nodiscard]] const double* coefficients() const { return coefficients_.data(); }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] double knots_per_px_x() const { return knots_per_px_x_; }
  [[nodiscard]] double knots_per_px_y() const { return knots_per_px_y_; }

 private:
  int columns_ = 0;
  int rows_ = 0;
  double knots_per_px_x_ = 0.0;
  double knots_per_px_y_ = 0.0;
  std::vector<double> coefficients_;
};

}  // namespace lenticule::optics
