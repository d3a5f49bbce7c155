// SPDX-License-Identifier: Apache-2.0
// A built-in scene as the renderer takes it.
#pragma once

#include <optional>

#include "render/scene/scene_description.h"
#include "scenes/scene_list.h"

namespace lenticule::player {

/// What the reader makes of the scene's NFF text, and the surfaces that wear pictures. Its source
/// is "builtin:NAME". Throws as scenes::build_scene does.
[[nodiscard]] render::SceneDescription describe_built_in(const scenes::BuiltInScene& scene,
                                                         std::optional<int> size = {},
                                                         int frame = 0);

}  // namespace lenticule::player
