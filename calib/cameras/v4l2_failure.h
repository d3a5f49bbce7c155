// SPDX-License-Identifier: Apache-2.0
// Translates failed camera calls to messages with a remedy.
#pragma once

#include <string>

#include "base/error.h"
#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

/// Returns the system's text for an errno in lower case, as in a sentence: "no such device".
///
/// Thread safety: any thread.
[[nodiscard]] std::string error_text(int error);

/// Returns an Error(Device) for `path` that could not be opened, or refused `doing` during setup
/// ("set the format"). Names the programs that have the camera open, and the missing group.
[[nodiscard]] Error camera_failure(V4l2System& system, const std::string& path,
                                   const std::string& doing, int error);

}  // namespace lenticule::calib
