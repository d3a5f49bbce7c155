// SPDX-License-Identifier: Apache-2.0
#include "optics/residual_spline.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lenticule::optics {
namespace {

using Cubic = std::array<double, 4>;

/// Returns the Catmull-Rom segment between b and c, by powers of its parameter.
Cubic catmull_rom(double a, double b, double c, double d) {
  return {b, 0.5 * (c - a), a - 2.5 * b + 2.0 * c - 0.5 * d, 0.5 * (d - a) + 1.5 * (b - c)};
}

/// Returns knot `index` of a line of `count` knots, extrapolated in a straight line on both sides.
template <class Knot>
double extended(Knot knot, int count, int index) {
  if (index >= 0 && index < count) return knot(index);
  const int last = count - 1;
  if (last == 0) return knot(0);
  return index < 0 ? knot(0) + index * (knot(1) - knot(0))
                   : knot(last) + (index - last) * (knot(last) - knot(last - 1));
}

double knot(const ResidualMap& map, int column, int row) {
  return extended(
      [&](int r) {
        return extended([&](int c) { return map.lenses[static_cast<size_t>(r * map.columns + c)]; },
                        map.columns, column);
      },
      map.rows, row);
}

void append_cell(const ResidualMap& map, int column, int row, std::vector<double>& out) {
  std::array<Cubic, 4> along_x;
  for (int i = 0; i < 4; ++i) {
    const int r = row + i - 1;
    along_x[static_cast<size_t>(i)] =
        catmull_rom(knot(map, column - 1, r), knot(map, column, r), knot(map, column + 1, r),
                    knot(map, column + 2, r));
  }
  std::array<double, 16> cell{};
  for (size_t q = 0; q < 4; ++q) {
    const Cubic down = catmull_rom(along_x[0][q], along_x[1][q], along_x[2][q], along_x[3][q]);
    for (size_t p = 0; p < 4; ++p) cell[4 * p + q] = down[p];
  }
  out.insert(out.end(), cell.begin(), cell.end());
}

struct Place {
  int cell;
  double inside;
};
Place locate(double grid, int count) {
  const double cell = std::clamp(std::floor(grid), -1.0, count - 1.0);
  return {static_cast<int>(cell), grid - cell};
}

}  // namespace

ResidualSpline::ResidualSpline(const ResidualMap& map, int width_px, int height_px) {
  if (map.empty()) return;
  columns_ = map.columns;
  rows_ = map.rows;
  knots_per_px_x_ = (columns_ - 1.0) / width_px;
  knots_per_px_y_ = (rows_ - 1.0) / height_px;
  coefficients_.reserve(static_cast<size_t>((columns_ + 1) * (rows_ + 1)) * 16);
  for (int row = -1; row < rows_; ++row) {
    for (int column = -1; column < columns_; ++column) append_cell(map, column, row, coefficients_);
  }
}

ResidualSpline::Value ResidualSpline::at(double x_px, double y_px) const {
  if (empty()) return {};
  const Place x = locate(x_px * knots_per_px_x_, columns_);
  const Place y = locate(y_px * knots_per_px_y_, rows_);
  const double* cell =
      &coefficients_[static_cast<size_t>((y.cell + 1) * (columns_ + 1) + x.cell + 1) * 16];
  const auto power = [&](int q) {
    const double u = y.inside;
    return ((cell[12 + q] * u + cell[8 + q]) * u + cell[4 + q]) * u + cell[q];
  };
  const double c0 = power(0), c1 = power(1), c2 = power(2), c3 = power(3), t = x.inside;
  return {.lenses = ((c3 * t + c2) * t + c1) * t + c0,
          .per_px_x = ((3.0 * c3 * t + 2.0 * c2) * t + c1) * knots_per_px_x_};
}

}  // namespace lenticule::optics
