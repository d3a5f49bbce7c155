// SPDX-License-Identifier: Apache-2.0
// DepthOfField computes the distance from the panel up to which a lens sheet shows full detail.
#pragma once

#include "optics/model.h"

namespace lenticule::render {

/// DepthOfField describes one rig. From one subpixel of a lens to the next, the tangent of the rays
/// changes by d. A point at depth z moves by |z| d on the panel, and is no longer sharp if this is
/// more than a lens pitch p_h. Refraction spreads oblique rays: with kappa = 1 - nu,
///
/// depth of field = p_h / d = g P (1 + kappa t_y^2) / (1 + kappa (t_x^2 + t_y^2))^(3/2),
///
/// where d is the derivative of t_x by the panel point (docs/panel/optics.md, "Depth of field").
/// Residual maps are ignored: they change the pitch, and so the depth of field, by at most ten
/// percent.
class DepthOfField {
 public:
  explicit DepthOfField(const optics::OpticalModel& model);

  /// Returns g P, millimetres in front of and behind the panel: the depth of field of rays
  /// perpendicular to the panel.
  [[nodiscard]] double straight_mm() const { return straight_mm_; }
  /// Returns the depth of field along a ray in direction (tan_x, tan_y, 1). Tangents above 1 count
  /// as 1.
  [[nodiscard]] double along_mm(double tan_x, double tan_y) const;
  /// Returns a lower bound for all rays.
  [[nodiscard]] double least_mm() const;

 private:
  double straight_mm_;
  double kappa_;
};

}  // namespace lenticule::render
