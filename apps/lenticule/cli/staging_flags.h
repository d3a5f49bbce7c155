// SPDX-License-Identifier: Apache-2.0
// Flags of commands that put a scene on the glass: how it lies there, and what is around it.
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
  // As given, until complete():
  std::string centre;
  std::string background;
  std::string ground_colour;

  /// Reads what is made of several numbers. Throws Error(Usage).
  void complete();
};

/// `flags` must outlive the parser.
void declare_stage_flags(CLI::App& app, StagingFlags& flags);
void declare_surroundings_flags(CLI::App& app, StagingFlags& flags);

}  // namespace lenticule::player
