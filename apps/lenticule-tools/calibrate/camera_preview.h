// SPDX-License-Identifier: Apache-2.0
// Shows the user what a camera sees: small pictures and a short text about light and framing.
#pragma once

#include <string>

#include "calib/camera.h"

namespace lenticule::tools {

/// Takes one picture and writes it, at most 960 pixels wide. Returns false if no picture came
/// within a second. Throws Error(Failed) if it cannot be written.
bool write_preview(calib::Camera& camera, const std::string& file);

/// Returns "brightest 71 %, clipped 0.0 %": percent of full scale, and the clipped part of the
/// picture.
[[nodiscard]] std::string light_of(const calib::CameraPicture& picture);
/// Writes the picture as a PNG in sRGB.
void write_picture(const calib::CameraPicture& picture, const std::string& file);

}  // namespace lenticule::tools
