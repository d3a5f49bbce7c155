// SPDX-License-Identifier: Apache-2.0
// Completes what scene files leave to the viewer: what of them is shown, the exposure, the points
// that cameras look at, and the metallic-roughness materials that stand for others.
#pragma once

#include <string>
#include <vector>

#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// ViewerChoices states what of a file is shown, each by its name or its number, from 1. Empty
/// ones take what the file or the order in it suggests.
struct ViewerChoices {
  std::string scene{}, animation{}, variant{}, camera{};
};

/// Returns the names with the one that the user wants: by name, by number, or "all" or "none" of
/// the animations; `otherwise` if `wanted` is empty. Throws Error(Input) with the names for what is
/// not there; `kind` is a noun for messages.
[[nodiscard]] Selection select(const std::vector<std::string>& names, const std::string& wanted,
                               const std::string& kind, const std::string& source, int otherwise);

/// Sets the camera of a loaded scene, and notes what is left out unless the user chose. Throws as
/// select(), also if the file's format has none of what is wanted.
void apply_choices(SceneDescription& scene, const ViewerChoices& wanted);

/// Scales all lights by a common factor, light_scale, so that they light the centre of the scene
/// well. Files use candela, watts or arbitrary units, and leave the exposure to the viewer.
void expose(SceneDescription& scene);

/// Returns true if the numbers are finite and state a view.
[[nodiscard]] bool is_usable(const Camera& camera);

/// Moves `at` along the view to the depth of the middle of `bounds`, the bounds of the scene, where
/// the panel will be.
void focus(Camera& camera, const SceneDescription& scene, const Box& bounds);

/// Returns the metallic-roughness material that is most like a Whitted one.
[[nodiscard]] PbrMaterial pbr_like(const Material& material);

}  // namespace lenticule::render
