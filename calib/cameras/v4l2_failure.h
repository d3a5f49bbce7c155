// SPDX-License-Identifier: Apache-2.0
// What a failed call to a camera means to people, and what they can do about it.
#pragma once

#include <string>

#include "base/error.h"
#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

/// The system's words for an errno, as in a sentence: "no such device". Any thread.
[[nodiscard]] std::string error_text(int error);

/// An Error(Device) for `path` that could not be opened, or refused `doing` while being set up
/// ("set the format"). Names who has the camera, and the group that is missing.
[[nodiscard]] Error camera_failure(V4l2System& system, const std::string& path,
                                   const std::string& doing, int error);

}  // namespace lenticule::calib
