// SPDX-License-Identifier: Apache-2.0
// How far from the glass a sheet of lenses shows all the detail it can.
#pragma once

#include "optics/model.h"

namespace lenticule::render {

/// Of one rig. From one subpixel of a lens to the next, the tangent of the rays changes by d; a
/// point at depth z moves by |z| d on the glass, and its sharpness is gone where that is more than
/// a lens pitch p_h. Refraction spreads oblique rays: with kappa = 1 - nu,
///
///   depth of field = p_h / d = g P (1 + kappa t_y^2) / (1 + kappa (t_x^2 + t_y^2))^(3/2),
///
/// d being the derivative of t_x by the panel point (docs/optics.md, "Depth of field"). Residual
/// maps are left out: they change the pitch, and with it this, by ten percent at most.
class DepthOfField {
 public:
  explicit DepthOfField(const optics::OpticalModel& model);

  /// g P, millimetres before and behind the glass: of rays that leave it at right angles.
  [[nodiscard]] double straight_mm() const { return straight_mm_; }
  /// Of a ray in direction (tan_x, tan_y, 1). Tangents beyond 1 count as 1.
  [[nodiscard]] double along_mm(double tan_x, double tan_y) const;
  /// No ray has less.
  [[nodiscard]] double least_mm() const;

 private:
  double straight_mm_;
  double kappa_;
};

}  // namespace lenticule::render
