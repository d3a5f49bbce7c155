// SPDX-License-Identifier: Apache-2.0
// Lights that bring nothing to anything in a scene.
#pragma once

#include <cstddef>

#include "render/scene/scene.h"

namespace lenticule::render {

/// Takes lights of zero colour, and spots whose cone passes by all that is in the scene, out of
/// scene.lights, and returns how many those were. Each would have added exactly zero to every
/// surface. Before anything is made of the lights.
size_t remove_idle_lights(Scene& scene);

}  // namespace lenticule::render
