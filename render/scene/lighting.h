// SPDX-License-Identifier: Apache-2.0
// What shines on a scene whose description leaves that open.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Flat ambient light of a scene that states none.
inline constexpr double kDefaultAmbient = 0.12;

/// A scene with neither lights nor ambient light is lit by a sun of this intensity, from the upper
/// left behind the viewer's shoulder; this is the way its light travels in the panel frame.
inline constexpr double kDefaultSun = 0.9;
inline constexpr Vec3 kDefaultSunDirection{0.4, -0.6, -1.0};

}  // namespace lenticule::render
