// SPDX-License-Identifier: Apache-2.0
// Averages large photographs down, so that measuring takes at most a second.
#pragma once

#include "calib/camera.h"
#include "calib/photo/photo_pose.h"
#include "calib/photo/tag_finder.h"

namespace lenticule::calib {

/// AveragedPhoto is a photograph in which squares of pixels became one pixel each.
struct AveragedPhoto {
  PhotoLight light;
  int averaged = 1;  ///< side of the squares

  /// Scales priors, which refer to the photograph, to this picture.
  [[nodiscard]] PhotoPriors scaled(PhotoPriors priors) const;
};

/// Returns a picture of at most 2600 pixels along its longer side.
[[nodiscard]] AveragedPhoto average_down(const CameraPicture& photograph);

}  // namespace lenticule::calib
