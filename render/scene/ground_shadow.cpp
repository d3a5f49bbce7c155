// SPDX-License-Identifier: Apache-2.0
#include "render/scene/ground_shadow.h"

#include <utility>

#include "base/error.h"

namespace lenticule::render {

GroundShadow::GroundShadow(const GroundGrid& grid, std::vector<float> darkness)
    : grid_(grid), darkness_(std::move(darkness)) {
  LENTICULE_CHECK(grid.columns > 1 && grid.rows > 1 &&
                  darkness_.size() == static_cast<size_t>(grid.columns) * grid.rows);
}

std::optional<GroundShadow::Place> GroundShadow::place(Vec3 origin, Vec3 direction,
                                                       double& parameter) const {
  const double falls = -dot(direction, grid_.up);
  if (!(falls > 0.0)) return std::nullopt;
  parameter = (dot(origin, grid_.up) - grid_.height) / falls;
  const Vec3 at = origin + direction * parameter;
  const Place place{(dot(at, grid_.across) - grid_.x) / grid_.cell,
                    (dot(at, grid_.along) - grid_.y) / grid_.cell};
  const bool inside = place.column >= 0.0 && place.column < grid_.columns - 1 && place.row >= 0.0 &&
                      place.row < grid_.rows - 1;
  return inside ? std::optional(place) : std::nullopt;  // NaN is outside
}

std::optional<double> GroundShadow::crossing(Vec3 origin, Vec3 direction) const {
  double parameter = 0.0;
  return place(origin, direction, parameter) ? std::optional(parameter) : std::nullopt;
}

double GroundShadow::light_left(Vec3 origin, Vec3 direction) const {
  double parameter = 0.0;
  const std::optional<Place> at = place(origin, direction, parameter);
  if (!at) return 1.0;
  const auto column = static_cast<size_t>(at->column), row = static_cast<size_t>(at->row);
  const double right = at->column - static_cast<double>(column);
  const double below = at->row - static_cast<double>(row);
  const auto stride = static_cast<size_t>(grid_.columns);
  const float* first = darkness_.data() + row * stride + column;
  const auto in_row = [right](const float* points) {
    return (1.0 - right) * double{points[0]} + right * double{points[1]};
  };
  return 1.0 - ((1.0 - below) * in_row(first) + below * in_row(first + stride));
}

std::array<Vec3, 4> GroundShadow::corners() const {
  const double right = grid_.columns - 1, below = grid_.rows - 1;
  return {grid_.point(0, 0), grid_.point(right, 0), grid_.point(right, below),
          grid_.point(0, below)};
}

}  // namespace lenticule::render
