// SPDX-License-Identifier: Apache-2.0
// Footprint of a subpixel: rays of samples inside its area and across its lens. Beam bounds a
// bundle of primary rays.
#pragma once

#include <vector>

#include "base/interval.h"
#include "optics/model.h"

namespace lenticule::render {

/// SubpixelPlace is a sample position. x and y are relative to the subpixel's centre, in fractions
/// of its width and height; `lens` is relative to the apex line of its lens, in fractions of the
/// lens pitch. Each lies in [-1/2, 1/2); x and lens increase to the right, y down.
struct SubpixelPlace {
  double x = 0.0;
  double y = 0.0;
  double lens = 0.0;
};

/// Returns a fixed stratified pattern (Hammersley points); a single sample is the centre.
[[nodiscard]] std::vector<SubpixelPlace> footprint_samples(int count);

/// PanelRay is the line of a ray: through (x_mm, y_mm, 0) in direction (tan_x, tan_y, 1).
struct PanelRay {
  double x_mm = 0.0;
  double y_mm = 0.0;
  double tan_x = 0.0;
  double tan_y = 0.0;
};

/// Footprint moves a subpixel's centre ray to another place of the same subpixel, under the same
/// lens.
class Footprint {
 public:
  Footprint(const optics::OpticalModel& model, SubpixelPlace place);

  /// Returns the ray through the displaced place. The lens point moves along the lens's apex line
  /// with the row; the remaining offset between panel point and lens point bends the ray by the
  /// sheet's refraction law. Slowly varying terms (the residual map, the exact law's vertical
  /// shift) are taken as constant across the subpixel, with an error below a hundredth of a
  /// subpixel. An eye sees the whole width of a lens in one colour: rays beside the apex line go to
  /// the point on the viewing line that the ray through the apex line goes to.
  [[nodiscard]] PanelRay displaced(const PanelRay& centre) const {
    return centred_ ? centre : moved(centre);
  }
  [[nodiscard]] bool centred() const { return centred_; }

 private:
  [[nodiscard]] PanelRay moved(const PanelRay& centre) const;
  [[nodiscard]] PanelRay through_apex(const PanelRay& centre) const;

  bool centred_;
  double lens_dx_mm_;  ///< displacement of the lens point
  double lens_dy_mm_;
  double shift_dx_mm_;  ///< displacement of the lens point minus that of the panel point
  double gap_mm_;
  double shape_;       ///< 1 - nu
  double tan_per_mm_;  ///< change of tan_x and tan_y per millimetre on the panel
  double across_lens_mm_;
};

[[nodiscard]] Interval operator*(Interval a, Interval b);

/// All rays (x + tan_x z, y + tan_y z, z), z < start_mm, with parameters in these intervals, in the
/// panel frame.
struct Beam {
  Interval x_mm, tan_x;
  Interval y_mm, tan_y;
  double start_mm = 0.0;

  void extend(const Beam& other);
};

}  // namespace lenticule::render
