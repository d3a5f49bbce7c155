// SPDX-License-Identifier: Apache-2.0
#include "render/scene/ground_shadow.h"

#include <utility>

#include "base/error.h"

namespace lenticule::render {

GroundShadow::GroundShadow(const GroundGrid& grid, std::vector<float> darkness)
    : grid_(grid),
      column_axis_(grid.across / grid.cell),
      row_axis_(grid.along / grid.cell),
      first_column_(grid.x / grid.cell),
      first_row_(grid.y / grid.cell),
      darkness_(std::move(darkness)) {
  LENTICULE_CHECK(grid.columns > 1 && grid.rows > 1 &&
                  darkness_.size() == static_cast<size_t>(grid.columns) * grid.rows);
}

double GroundShadow::light_at(double column, double row) const {
  const bool inside =
      column >= 0.0 && column < grid_.columns - 1 && row >= 0.0 && row < grid_.rows - 1;
  if (!inside) return 1.0;  // also for NaN
  const auto left = static_cast<size_t>(column), above = static_cast<size_t>(row);
  const double right = column - static_cast<double>(left);
  const double below = row - static_cast<double>(above);
  const auto stride = static_cast<size_t>(grid_.columns);
  const float* first = darkness_.data() + above * stride + left;
  const auto in_row = [right](const float* points) {
    return (1.0 - right) * double{points[0]} + right * double{points[1]};
  };
  return 1.0 - ((1.0 - below) * in_row(first) + below * in_row(first + stride));
}

double GroundShadow::light_left(Vec3 origin, Vec3 direction) const {
  const double falls = -dot(direction, grid_.up);
  if (!(falls > 0.0)) return 1.0;
  const double parameter = (dot(origin, grid_.up) - grid_.height) / falls;
  return light_at(
      dot(origin, column_axis_) - first_column_ + parameter * dot(direction, column_axis_),
      dot(origin, row_axis_) - first_row_ + parameter * dot(direction, row_axis_));
}

void GroundShadow::light_left(const Rays& rays, std::array<double, kRays>& out) const {
  std::array<double, kRays> falls, columns, rows;
  for (size_t r = 0; r < kRays; ++r) {
    const Vec3 origin{double{rays.origin_x[r]}, double{rays.origin_y[r]}, double{rays.origin_z[r]}};
    const Vec3 direction{double{rays.direction_x[r]}, double{rays.direction_y[r]},
                         double{rays.direction_z[r]}};
    falls[r] = -dot(direction, grid_.up);
    const double parameter = (dot(origin, grid_.up) - grid_.height) / falls[r];
    columns[r] =
        dot(origin, column_axis_) - first_column_ + parameter * dot(direction, column_axis_);
    rows[r] = dot(origin, row_axis_) - first_row_ + parameter * dot(direction, row_axis_);
  }
  for (size_t r = 0; r < kRays; ++r) out[r] = falls[r] > 0.0 ? light_at(columns[r], rows[r]) : 1.0;
}

std::array<Vec3, 4> GroundShadow::corners() const {
  const double right = grid_.columns - 1, below = grid_.rows - 1;
  return {grid_.point(0, 0), grid_.point(right, 0), grid_.point(right, below),
          grid_.point(0, below)};
}

GroundShadow::Row::Row(const GroundShadow& shadow, const Affine& shadow_from_frame, double y,
                       double tan_y)
    : shadow_(shadow) {
  const Vec3 point = shadow_from_frame.point({0.0, y, 0.0});
  const Vec3 direction = shadow_from_frame.vector({0.0, -tan_y, -1.0});
  const Vec3 x_axis = shadow_from_frame.vector({1.0, 0.0, 0.0});
  const auto of_points = [&](Vec3 axis, double first) {
    return Linear{dot(point, axis) - first, dot(x_axis, axis)};
  };
  const auto of_directions = [&](Vec3 axis) {
    return Linear{dot(direction, axis), -dot(x_axis, axis)};
  };
  const GroundGrid& grid = shadow.grid_;
  height_ = of_points(grid.up, grid.height);
  column_ = of_points(shadow.column_axis_, shadow.first_column_);
  row_ = of_points(shadow.row_axis_, shadow.first_row_);
  falls_ = of_directions(-grid.up);
  column_step_ = of_directions(shadow.column_axis_);
  row_step_ = of_directions(shadow.row_axis_);
}

double GroundShadow::Row::light_left(double x, double tan_x) const {
  const double falls = falls_.at(tan_x);
  if (!(falls > 0.0)) return 1.0;
  const double parameter = height_.at(x) / falls;
  return shadow_.light_at(column_.at(x) + parameter * column_step_.at(tan_x),
                          row_.at(x) + parameter * row_step_.at(tan_x));
}

}  // namespace lenticule::render
