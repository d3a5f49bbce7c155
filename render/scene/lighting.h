// SPDX-License-Identifier: Apache-2.0
// Default lights for scenes whose description specifies none.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Flat ambient light of a scene that states none.
inline constexpr double kDefaultAmbient = 0.12;

/// Intensity of the default sun, which lights a scene with neither lights nor ambient light. Its
/// light comes from the upper left behind the viewer; kDefaultSunDirection is the direction in
/// which its light travels, along the panel's axes in the undistorted scene.
inline constexpr double kDefaultSun = 0.9;
inline constexpr Vec3 kDefaultSunDirection{0.4, -0.6, -1.0};

}  // namespace lenticule::render
