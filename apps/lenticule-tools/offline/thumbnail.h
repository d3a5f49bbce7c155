// SPDX-License-Identifier: Apache-2.0
// A FlatView is a picture of a scene without depth, as write_thumbnail writes it.
#pragma once

#include <filesystem>

#include "optics/model.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::tools {

/// FlatView is a panel that shows every eye the same picture, seen from where the scene's camera
/// is, or without a camera from some way off. Its stage does not compress the depth.
struct FlatView {
  optics::OpticalModel model;
  render::Stage stage;
};

/// Returns the view of a scene whose nodes are evaluated. Throws as render::make_stage does.
[[nodiscard]] FlatView make_flat_view(const render::SceneDescription& scene);

/// Renders the view and writes it. Throws Error(Usage) for a kind of file that cannot be written.
void write_thumbnail(const render::SceneDescription& scene, const FlatView& view,
                     const std::filesystem::path& file);

}  // namespace lenticule::tools
