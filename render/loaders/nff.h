// SPDX-License-Identifier: Apache-2.0
// Reads the Neutral File Format: the line-based scene format of the classic ray-tracing test
// databases.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Reads every kind of line: v, b, l, f, s, c, p, pp and '#'. Throws Error(Input) "source:line:
/// reason" for the first error. Takes time linear in the text, except for concave polygons (see
/// triangulate).
[[nodiscard]] SceneDescription parse_nff(std::string_view text, const std::string& source);

[[nodiscard]] SceneDescription load_nff(const std::filesystem::path& file);

}  // namespace lenticule::render
