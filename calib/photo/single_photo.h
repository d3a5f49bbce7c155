// SPDX-License-Identifier: Apache-2.0
// Calibrates from a single photograph of the chart, taken from the viewer's eye position.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/camera.h"
#include "calib/photo/fringe_blocks.h"
#include "calib/photo/photo_pose.h"
#include "calib/photo/tag_chart.h"

namespace lenticule::calib {

/// PhotoFindings is what one photograph of the chart shows, for a fit of several photographs.
struct PhotoFindings {
  std::string refusal;  ///< reason why the photograph cannot be used; empty if it can
  int averaged = 1;     ///< side of the square of its pixels that became one pixel below
  int width = 0;        ///< size of the averaged picture
  int height = 0;
  std::vector<TagSighting> tags;    ///< corners are in pixels of the averaged picture
  std::optional<PhotoPose> pose;    ///< from this photograph alone
  optics::Rig rig;                  ///< pitch, slant, offset and map for this pose alone
  std::vector<FringeBlock> blocks;  ///< deviations from that rig
  int columns = 0, rows = 0;        ///< numbers of blocks across and down the panel
  double contrast = 0.0;
  double covered = 0.0;
  double saturated = 0.0;  ///< fraction of the values on the panel that were clipped
};

/// Measures a photograph as fit_single_photo() does.
[[nodiscard]] PhotoFindings measure_photo(const CameraPicture& photograph,
                                          const SinglePhotoChart& chart,
                                          const PhotoPriors& priors = {});

/// Finds tags, camera and fringes, and computes pitch, slant and offset for this eye. The verdict
/// is Effective, or Refused with the reasons: too few tags, too few or too faint fringes, clipped
/// light, phases that fit no plane. Throws nothing for the content of a picture.
///
/// The viewpoint has the values of docs/panel/optics.md: effective pitch P (1 + g/Ez), the phase at
/// the panel's centre, the residual per block. The rig has the pitch, slant and offset that give
/// these values for this eye with the gap of the chart's rig, a residual map if residuals exceed
/// 0.02 lenses without one, and a viewing line through the eye. camera.k1 is the outward
/// displacement of a point one focal length off the axis.
///
/// One photograph takes at most a second and some hundred megabytes: larger ones are averaged down
/// to 2600 pixels along their longer side.
///
/// Thread safety: any thread; starts no threads.
[[nodiscard]] Calibration fit_single_photo(const CameraPicture& photograph,
                                           const SinglePhotoChart& chart,
                                           const PhotoPriors& priors = {});

}  // namespace lenticule::calib
