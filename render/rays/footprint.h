// SPDX-License-Identifier: Apache-2.0
// The footprint of a subpixel: where samples inside its area, and across its lens, send their rays.
#pragma once

#include <vector>

#include "optics/model.h"

namespace lenticule::render {

/// A place inside a subpixel relative to its centre, in parts of its width and height, and across
/// its lens relative to the apex line, in parts of the lens pitch: [-1/2, 1/2) each, x and lens to
/// the right, y down.
struct SubpixelPlace {
  double x = 0.0;
  double y = 0.0;
  double lens = 0.0;
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
  /// of a subpixel. An eye sees a lens in one colour all across: beside the apex line, rays go to
  /// the place on the viewing line that the ray through the apex line goes to.
  [[nodiscard]] PanelRay displaced(const PanelRay& centre) const {
    return centred_ ? centre : moved(centre);
  }
  [[nodiscard]] bool centred() const { return centred_; }

 private:
  [[nodiscard]] PanelRay moved(const PanelRay& centre) const;
  [[nodiscard]] PanelRay through_apex(const PanelRay& centre) const;

  bool centred_;
  double lens_dx_mm_;  ///< of the lens point
  double lens_dy_mm_;
  double shift_dx_mm_;  ///< of lens point minus panel point
  double gap_mm_;
  double shape_;       ///< 1 - nu
  double tan_per_mm_;  ///< of tan_x and tan_y, by the place on the glass
  double across_lens_mm_;
};

}  // namespace lenticule::render
