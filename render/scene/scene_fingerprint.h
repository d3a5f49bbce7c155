// SPDX-License-Identifier: Apache-2.0
// Fingerprints that detect if two frames show the same scene.
#pragma once

#include "render/scene/fingerprint.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// Returns a fingerprint of everything that determines the appearance of the scene's points:
/// geometry, materials, lights and environment settings. Cameras, names, notes and texture pixels
/// are excluded; callers that need the pixels compare them separately, since every committed scene
/// has a fingerprint. The stage contributes only the direction of the default sun.
[[nodiscard]] Fingerprint scene_fingerprint(const SceneDescription& scene,
                                            const Surroundings& surroundings, const Stage& stage);

/// Returns a fingerprint of a scene together with its stage: everything that determines a committed
/// scene, except the pixels of textures and of the environment picture.
[[nodiscard]] Fingerprint picture_fingerprint(const Fingerprint& scene, const Stage& stage);

}  // namespace lenticule::render
