// SPDX-License-Identifier: Apache-2.0
// Fits the camera's positions and optics to the panel points that it saw.
#pragma once

#include <optional>

#include "calib/fit/observations.h"

namespace lenticule::calib {

/// CameraSameness says whether the camera may differ from view to view.
enum class CameraSameness {
  Same,    ///< one focal length and principal point
  Nearly,  ///< each view's own, within the breathing of a lens and the range of a stabiliser
};

struct PoseFit {
  CameraValues camera{};
  std::vector<OwnCameraValues> own;  ///< zero for CameraSameness::Same
  std::vector<PoseValues> poses;
  double rms_px = 0.0;  ///< panel pixels, per coordinate
};

/// Fits the camera to all views; the sheet is held. Starts from the homographies of the views, with
/// several focal lengths. Returns nothing if no camera fits. If all views face the panel squarely,
/// a weak prior of 0.9 picture widths determines the focal length.
[[nodiscard]] std::optional<PoseFit> fit_poses(const std::vector<View>& views,
                                               const SheetParameters& sheet,
                                               const optics::Panel& panel,
                                               CameraSameness sameness = CameraSameness::Same);

}  // namespace lenticule::calib
