// SPDX-License-Identifier: Apache-2.0
// Removal of lights that cannot contribute to any surface of a scene.
#pragma once

#include <cstddef>

#include "render/scene/scene.h"

namespace lenticule::render {

/// Removes lights of zero colour, and spots whose cone misses the whole scene, from scene.lights;
/// returns the number of removed lights. Each of them would have added exactly zero to every
/// surface. Must be called before any data is derived from the lights.
size_t remove_idle_lights(Scene& scene);

}  // namespace lenticule::render
