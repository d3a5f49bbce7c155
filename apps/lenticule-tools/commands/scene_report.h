// SPDX-License-Identifier: Apache-2.0
// Reports what a scene file holds and what of it is shown.
#pragma once

#include <nlohmann/json.hpp>

#include "render/scene/scene_description.h"

namespace lenticule::tools {

/// Returns the report about a loaded scene. `up` is the world axis that is up on a panel.
[[nodiscard]] nlohmann::json scene_report(const render::SceneDescription& scene, Vec3 up);

/// Prints the report for people.
void print_scene_report(const nlohmann::json& report);

}  // namespace lenticule::tools
