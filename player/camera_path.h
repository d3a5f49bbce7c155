// SPDX-License-Identifier: Apache-2.0
// A camera for every frame, from a text file.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "render/scene_description.h"

namespace lenticule::player {

/// One line per frame: from x y z, at x y z, up x y z, and optionally the vertical field of view in
/// degrees (45). '#' starts a comment; empty lines do not count. Throws Error(Input) "file:line:
/// cause".
[[nodiscard]] std::vector<render::Camera> parse_camera_path(std::string_view text,
                                                            const std::string& source);
[[nodiscard]] std::vector<render::Camera> load_camera_path(const std::filesystem::path& file);

}  // namespace lenticule::player
