// SPDX-License-Identifier: Apache-2.0
// Calibrates from two or more hand-held photographs of the chart.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/photo/single_photo.h"

namespace lenticule::calib {

/// PhonePhoto is one photograph's findings and the name for messages.
struct PhonePhoto {
  std::string name;
  PhotoFindings findings;
};

/// Measures a photograph whose distance is unknown. Refuses it also for light that
/// fit_single_photo() tolerates. With `only_tags` it measures no fringes, as for the choice of a
/// film's frames.
[[nodiscard]] PhotoFindings measure_hand_held(const CameraPicture& photograph,
                                              const SinglePhotoChart& chart,
                                              const Estimate& focal_px, bool only_tags = false);

/// Returns a start from which the chart should be planned again, if the photograph shows that the
/// pitch of the chart's start is more than a hundredth off: then part of the chart has too few
/// fringes to measure, part too many. A pitch whose chart has no room on the panel is a mistake of
/// the photograph and not returned.
[[nodiscard]] std::optional<optics::Rig> better_start(const PhotoFindings& seen,
                                                      const SinglePhotoChart& chart);

/// Fits all photographs that could be measured. `focal_px` refers to the original photographs. The
/// stated error, `drift`, is the limit within which 97 of 100 results stay over the whole panel for
/// eyes 250 mm to each side at 0.8 to 1.2 of the viewing distance. The verdict is Intrinsic if it
/// is within 0.0213 lens and no photograph is in doubt, Effective if it is within `most_lenses`,
/// else Refused. Reasons name the photographs.
[[nodiscard]] Calibration calibrate_phone(const std::vector<PhonePhoto>& photos,
                                          const SinglePhotoChart& chart, const Estimate& focal_px,
                                          double most_lenses = 0.0);

}  // namespace lenticule::calib
