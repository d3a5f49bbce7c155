// SPDX-License-Identifier: Apache-2.0
// describe_built_in makes a render::SceneDescription from a built-in scene.
#pragma once

#include <optional>

#include "render/scene/scene_description.h"
#include "scenes/scene_list.h"

namespace lenticule::tools {

/// Describes the scene's elements as the reader of NFF would, and adds the textured surfaces. The
/// source of the result is "builtin:NAME". Throws as scenes::build_scene does.
[[nodiscard]] render::SceneDescription describe_built_in(const scenes::BuiltInScene& scene,
                                                         std::optional<int> size = {},
                                                         int frame = 0);

}  // namespace lenticule::tools
