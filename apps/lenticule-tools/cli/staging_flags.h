// SPDX-License-Identifier: Apache-2.0
// StagingFlags are the flags that place a scene in front of the panel and set its environment.
#pragma once

#include "render/loaders/load_scene.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace CLI {
class App;
}

namespace lenticule::tools {

struct StagingFlags {
  render::LoadOptions load;
  render::StageOptions stage;      ///< with the turn of the first frame
  double turned_by_degrees = 0.0;  ///< over all frames
  render::Surroundings surroundings;
};

/// Lifetime: `flags` must outlive the parser.
void declare_stage_flags(CLI::App& app, StagingFlags& flags);
void declare_surroundings_flags(CLI::App& app, StagingFlags& flags);

}  // namespace lenticule::tools
