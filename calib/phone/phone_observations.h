// SPDX-License-Identifier: Apache-2.0
// Observations of one hand-held photograph for the joint fit. Pixels are those of the averaged
// picture.
#pragma once

#include <array>
#include <vector>

#include "calib/fit/projection.h"
#include "calib/photo/single_photo.h"

namespace lenticule::calib {

/// FringeSeen is the phase of the chart's fringes at a pixel.
struct FringeSeen {
  Vec2 pixel;
  Fringe fringe;                         ///< the chart's comb at this place
  double turns = 0.0;                    ///< comb minus lens coordinate, up to whole lenses
  double weight = 1.0;                   ///< relative to that of the usual block
  std::array<double, 3> colour_turns{};  ///< turns of red, green and blue minus `turns`
};

/// CornerSeen is a corner of a tag.
struct CornerSeen {
  Vec2 pixel;
  Vec2 panel_mm;
  Vec2 from_middle_mm;  ///< from the middle of its tag
};

struct PhoneObservations {
  std::vector<FringeSeen> phases;  ///< one phase for each of PhotoFindings::blocks, in their order
  std::vector<CornerSeen> corners;
  double pixels_per_mm = 1.0;  ///< scale of the tags
};

/// Converts the findings of a photograph that was measured without refusal.
[[nodiscard]] PhoneObservations phone_observations(const PhotoFindings& photo,
                                                   const SinglePhotoChart& chart);

}  // namespace lenticule::calib
