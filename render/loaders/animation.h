// SPDX-License-Identifier: Apache-2.0
// Baking of static nodes; see also at_time() in scene_description.h.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Transforms all content whose node never moves to world coordinates, and drops the nodes if none
/// moves, so that frames do not repeat this work.
void bake_still_nodes(SceneDescription& scene);

}  // namespace lenticule::render
