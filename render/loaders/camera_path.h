// SPDX-License-Identifier: Apache-2.0
// Reads camera path files, which hold the camera pose of each frame of a sequence.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Parses one pose per line, nine or ten numbers: from (3), at (3), up (3) and optionally the
/// vertical field of view in degrees, which also applies to the following lines (initially 45). '#'
/// starts a comment. Throws Error(Input) "source:line: reason"; a file without a pose is an error.
[[nodiscard]] std::vector<Camera> parse_camera_path(std::string_view text,
                                                    const std::string& source);
[[nodiscard]] std::vector<Camera> load_camera_path(const std::filesystem::path& file);

}  // namespace lenticule::render
