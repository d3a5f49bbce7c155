// SPDX-License-Identifier: Apache-2.0
// UpAxis names the axis of a scene file that points up, which many formats do not state.
#pragma once

#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::render {

enum class UpAxis { X, Y, Z, MinusX, MinusY, MinusZ };

/// Returns the axis named "x", "y", "z", "-x", "-y" or "-z". Throws Error(Usage) for other names.
[[nodiscard]] UpAxis up_axis_named(const std::string& name);

/// Rotates the whole scene by a multiple of a quarter turn, so that the axis points to +y.
void turn_upright(SceneDescription& scene, UpAxis up);

}  // namespace lenticule::render
