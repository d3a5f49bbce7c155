// SPDX-License-Identifier: Apache-2.0
// GroundShadow is the soft shadow under a model that the studio lights. The ground is not an
// object: the shadow darkens the background where a ray that meets nothing crosses the ground from
// above. So bounds, depths and surfaces are those of the model alone. docs/render/shading.md states
// the formula, render/commit_scene.cpp computes it.
#pragma once

#include <array>
#include <cstddef>
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
  /// Number of rays that are evaluated together.
  static constexpr size_t kRays = 16;
  /// Rays as Embree's packets hold them: arrays of kRays coordinates.
  struct Rays {
    const float *origin_x, *origin_y, *origin_z;
    const float *direction_x, *direction_y, *direction_z;
  };
  class Row;

  /// `darkness` is the share of the light that is missing, row by row, and zero at the border.
  GroundShadow(const GroundGrid& grid, std::vector<float> darkness);

  /// Returns the share of the background's light that a ray sees: less than 1 if its line crosses
  /// the shadow from above, also between the eye and the start of the ray.
  [[nodiscard]] double light_left(Vec3 origin, Vec3 direction) const;
  /// Computes the same for several rays; faster than one by one.
  void light_left(const Rays& rays, std::array<double, kRays>& out) const;
  /// Returns the corners of the grid.
  [[nodiscard]] std::array<Vec3, 4> corners() const;

 private:
  /// Returns the share at a place on the grid, in cells from the first point.
  [[nodiscard]] double light_at(double column, double row) const;

  GroundGrid grid_;
  Vec3 column_axis_, row_axis_;      ///< across and along, per cell
  double first_column_, first_row_;  ///< coordinates of the grid's first point, in cells
  std::vector<float> darkness_;
};

/// GroundShadow::Row evaluates the lines (x + tan_x z, y + tan_y z, z) of a frame in which y and
/// tan_y are the same for all of them. Lifetime: must not outlive the shadow.
class GroundShadow::Row {
 public:
  Row(const GroundShadow& shadow, const Affine& shadow_from_frame, double y, double tan_y);

  /// Returns the share of the background's light that a line sees from above.
  [[nodiscard]] double light_left(double x, double tan_x) const;

 private:
  /// The value at x or tan_x is `first` + `slope` times it.
  struct Linear {
    double first = 0.0, slope = 0.0;
    [[nodiscard]] double at(double x) const { return first + slope * x; }
  };

  const GroundShadow& shadow_;
  Linear height_, column_, row_;           ///< coordinates of a line's point at z = 0, by x
  Linear falls_, column_step_, row_step_;  ///< components of its direction, by tan_x
};

}  // namespace lenticule::render
