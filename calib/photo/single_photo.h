// SPDX-License-Identifier: Apache-2.0
// Calibration from a single photograph of the chart, taken from where the viewer's eye will be.
#pragma once

#include "calib/calibration.h"
#include "calib/camera.h"
#include "calib/photo/photo_pose.h"
#include "calib/photo/tag_chart.h"

namespace lenticule::calib {

/// Finds tags, camera and fringes, and from them pitch, slant and offset as they hold at that eye.
/// The verdict is Effective, or Refused with the reasons: too few tags, too few fringes or too
/// faint ones, clipped light, phases that fit no plane. Nothing is thrown for what a picture may
/// hold. The viewpoint has the numbers of docs/optics.md: effective pitch P (1 + g/Ez), the phase
/// at the panel's centre, what is left over per block. The rig has the pitch, slant and offset that
/// show this to that eye with the gap that the chart's rig had, a residual map where more than 0.02
/// lenses are left over without one, and a viewing line through the eye. camera.k1 is how much a
/// point one focal length off the axis is drawn outward. One photograph takes a second and some
/// hundred megabytes at most: larger ones are averaged down to 2600 pixels along their longer side.
/// Any thread, uses one.
[[nodiscard]] Calibration fit_single_photo(const CameraPicture& photograph,
                                           const SinglePhotoChart& chart,
                                           const PhotoPriors& priors = {});

}  // namespace lenticule::calib
