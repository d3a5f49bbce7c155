// SPDX-License-Identifier: Apache-2.0
// StagingFlags are the flags that place a scene in front of the panel and set its environment.
#pragma once

#include <string>

#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace CLI {
class App;
}

namespace lenticule::player {

struct StagingFlags {
  render::StageOptions stage;
  render::Surroundings surroundings;
  // Text as given, until complete() parses it.
  std::string centre;
  std::string background;
  std::string ground_colour;

  /// Parses the values that consist of several numbers. Throws Error(Usage).
  void complete();
};

/// Lifetime: `flags` must outlive the parser.
void declare_stage_flags(CLI::App& app, StagingFlags& flags);
void declare_surroundings_flags(CLI::App& app, StagingFlags& flags);

}  // namespace lenticule::player
