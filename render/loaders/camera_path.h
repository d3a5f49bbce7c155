// SPDX-License-Identifier: Apache-2.0
// Camera path files: where the camera stands in each frame of a sequence.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// One pose a line, nine or ten numbers: from (3), at (3), up (3) and, optionally, the vertical
/// field of view in degrees, which holds for the lines after it too (45 at first). '#' starts a
/// comment. Throws Error(Input) "source:line: reason"; a file without a pose is an error.
[[nodiscard]] std::vector<Camera> parse_camera_path(std::string_view text,
                                                    const std::string& source);
[[nodiscard]] std::vector<Camera> load_camera_path(const std::filesystem::path& file);

}  // namespace lenticule::render
