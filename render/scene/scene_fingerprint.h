// SPDX-License-Identifier: Apache-2.0
// Tells whether two frames show the same scene, apart from the camera.
#pragma once

#include "render/scene/fingerprint.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// Of everything that decides about what points of the scene look like: geometry, materials, lights
/// and surroundings, but not cameras, names and notes, nor the pixels of textures, which are
/// compared by whoever needs it (every scene that is committed has a fingerprint). The stage
/// decides only where the sun moves with it.
[[nodiscard]] Fingerprint scene_fingerprint(const SceneDescription& scene,
                                            const Surroundings& surroundings, const Stage& stage);

/// Of a scene together with where the stage puts it: all that a committed scene is made of, but for
/// the pixels of textures and of the surroundings' picture.
[[nodiscard]] Fingerprint picture_fingerprint(const Fingerprint& scene, const Stage& stage);

}  // namespace lenticule::render
