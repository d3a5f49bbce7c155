// SPDX-License-Identifier: Apache-2.0
// The angular footprint of a subpixel: where samples inside its area send their rays.
#pragma once

#include <vector>

#include "optics/model.h"

namespace lenticule::render {

/// A place inside a subpixel relative to its centre, in parts of its width and height:
/// [-1/2, 1/2) each, x to the right, y down.
struct SubpixelPlace {
  double x = 0.0;
  double y = 0.0;
};

/// A fixed stratified pattern (Hammersley points); one sample is the centre.
[[nodiscard]] std::vector<SubpixelPlace> footprint_samples(int count);

/// The line of one ray: through (x_mm, y_mm, 0) in direction (tan_x, tan_y, 1).
struct PanelRay {
  double x_mm = 0.0;
  double y_mm = 0.0;
  double tan_x = 0.0;
  double tan_y = 0.0;
};

/// Moves a subpixel's centre ray to another place of the same subpixel, under the same lens.
class Footprint {
 public:
  Footprint(const optics::OpticalModel& model, SubpixelPlace place);

  /// The lens point moves along the lens's apex line with the row; what the place is off the lens
  /// then, bends the ray by the sheet's refraction law. What varies slowly (the residual map, the
  /// exact law's vertical shift) is taken as constant across the subpixel: below a hundredth
  /// of a subpixel.
  [[nodiscard]] PanelRay displaced(const PanelRay& centre) const {
    return centred_ ? centre : moved(centre);
  }
  [[nodiscard]] bool centred() const { return centred_; }

 private:
  [[nodiscard]] PanelRay moved(const PanelRay& centre) const;

  bool centred_;
  double lens_dx_mm_;  ///< of the lens point
  double lens_dy_mm_;
  double shift_dx_mm_;  ///< of lens point minus panel point
  double gap_mm_;
  double shape_;  ///< 1 - nu
  double tan_y_per_mm_;
};

}  // namespace lenticule::render
