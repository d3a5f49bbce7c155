// SPDX-License-Identifier: Apache-2.0
// Sets the exposure of a scene whose file leaves it to the viewer.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Scales all lights by a common factor, light_scale, so that they light the centre of the scene
/// well. Files use candela, watts or arbitrary units, and leave the exposure to the viewer.
void expose(SceneDescription& scene);

}  // namespace lenticule::render
