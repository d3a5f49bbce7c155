// SPDX-License-Identifier: Apache-2.0
// Calibrates from a single photograph of the chart, taken from the viewer's eye position.
#pragma once

#include "calib/calibration.h"
#include "calib/camera.h"
#include "calib/photo/photo_pose.h"
#include "calib/photo/tag_chart.h"

namespace lenticule::calib {

/// Finds tags, camera and fringes, and computes pitch, slant and offset for this eye. The verdict
/// is Effective, or Refused with the reasons: too few tags, too few or too faint fringes, clipped
/// light, phases that fit no plane. Throws nothing for the content of a picture.
///
/// The viewpoint has the values of docs/optics.md: effective pitch P (1 + g/Ez), the phase at the
/// panel's centre, the residual per block. The rig has the pitch, slant and offset that give these
/// values for this eye with the gap of the chart's rig, a residual map if residuals exceed 0.02
/// lenses without one, and a viewing line through the eye. camera.k1 is the outward displacement of
/// a point one focal length off the axis.
///
/// One photograph takes at most a second and some hundred megabytes: larger ones are averaged down
/// to 2600 pixels along their longer side.
///
/// Thread safety: any thread; starts no threads.
[[nodiscard]] Calibration fit_single_photo(const CameraPicture& photograph,
                                           const SinglePhotoChart& chart,
                                           const PhotoPriors& priors = {});

}  // namespace lenticule::calib
