// SPDX-License-Identifier: Apache-2.0
// Nodes in motion: see also at_time() in scene_description.h.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Bakes everything whose node never moves into world coordinates, and drops the nodes if none
/// moves, so that frames do not pay for what stands still.
void bake_still_nodes(SceneDescription& scene);

}  // namespace lenticule::render
