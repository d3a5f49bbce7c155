// SPDX-License-Identifier: Apache-2.0
// What a camera sees, for people: small pictures and a few words about light and framing.
#pragma once

#include <string>

#include "calib/camera.h"

namespace lenticule::player {

/// Takes one picture and writes it, at most 960 pixels wide. False if there was none within a
/// second. Throws Error(Failed) if it cannot be written.
bool write_preview(calib::Camera& camera, const std::string& file);

/// "brightest 71 %, clipped 0.0 %": percent of full scale, part of the picture.
[[nodiscard]] std::string light_of(const calib::CameraPicture& picture);
/// The picture as a PNG, sRGB.
void write_picture(const calib::CameraPicture& picture, const std::string& file);

}  // namespace lenticule::player
