// SPDX-License-Identifier: Apache-2.0
// Where the camera was and what its optics are, from the panel points that it saw.
#pragma once

#include <optional>

#include "calib/fit/observations.h"

namespace lenticule::calib {

struct PoseFit {
  CameraValues camera{};
  std::vector<PoseValues> poses;
  double rms_px = 0.0;  ///< panel pixels, per coordinate
};

/// One camera at all views; the sheet is held. Starts from the homographies of the views, whatever
/// the focal length. Empty if no such camera exists. With views that all face the panel squarely
/// the focal length follows a loose belief of 0.9 picture widths.
[[nodiscard]] std::optional<PoseFit> fit_poses(const std::vector<View>& views,
                                               const SheetParameters& sheet,
                                               const optics::Panel& panel);

}  // namespace lenticule::calib
