// SPDX-License-Identifier: Apache-2.0
// Finds out that nothing of a scene would be seen, and why.
#pragma once

#include "optics/model.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Throws Error(Input) "source: nothing to see in this scene: reasons". Call it for a scene without
/// content; `scene.notes` should say what the loader has left out or dropped.
[[noreturn]] void refuse_empty(const SceneDescription& scene);

/// Returns false if no ray of the panel can meet the scene's content, because all of it lies beside
/// the rays, or in front of stage.near_mm. Nodes must be evaluated.
[[nodiscard]] bool content_meets_rays(const SceneDescription& scene, const Stage& stage,
                                      const optics::OpticalModel& model);

}  // namespace lenticule::render
