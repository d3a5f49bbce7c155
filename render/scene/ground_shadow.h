// SPDX-License-Identifier: Apache-2.0
// GroundShadow is the soft shadow under a model that the studio lights. The ground is not an
// object: the shadow darkens the background where a ray that meets nothing crosses the ground from
// above. So bounds, depths and surfaces are those of the model alone. docs/shading.md states the
// formula, render/commit/cast_ground_shadow.cpp computes it.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

/// GroundGrid is a rectangle of points on the ground, in the scene frame.
struct GroundGrid {
  Vec3 up, across, along;     ///< unit, perpendicular
  double height = 0.0;        ///< dot product of up with the points of the ground
  double x = 0.0, y = 0.0;    ///< dot products of across and along with the first point
  double cell = 0.0;          ///< distance between points
  int columns = 0, rows = 0;  ///< points

  [[nodiscard]] Vec3 point(double column, double row) const {
    return up * height + across * (x + column * cell) + along * (y + row * cell);
  }
};

/// GroundShadow holds the darkness at the points of a grid. Thread safety: immutable.
class GroundShadow {
 public:
  /// `darkness` is the share of the light that is missing, row by row, and zero at the border.
  GroundShadow(const GroundGrid& grid, std::vector<float> darkness);

  /// Returns the parameter at which a ray crosses the grid from above, if it does. The parameter is
  /// negative for ground between the eye and the start of the ray.
  [[nodiscard]] std::optional<double> crossing(Vec3 origin, Vec3 direction) const;
  /// Returns the share of the background's light that such a ray sees; 1 for other rays.
  [[nodiscard]] double light_left(Vec3 origin, Vec3 direction) const;
  /// Returns the corners of the grid.
  [[nodiscard]] std::array<Vec3, 4> corners() const;

 private:
  /// Place on the grid, in cells from the first point.
  struct Place {
    double column, row;
  };
  [[nodiscard]] std::optional<Place> place(Vec3 origin, Vec3 direction, double& parameter) const;

  GroundGrid grid_;
  std::vector<float> darkness_;
};

}  // namespace lenticule::render
