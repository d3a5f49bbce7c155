// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/cli/staging_flags.h"

#include <CLI/CLI.hpp>

#include "apps/lenticule/cli/triple.h"

namespace lenticule::player {

void StagingFlags::complete() {
  if (!centre.empty()) stage.centre = parse_triple("--centre", centre);
  if (!background.empty()) surroundings.background = parse_triple("--background", background);
  if (!ground_colour.empty()) {
    surroundings.ground = true;
    surroundings.ground_colour = parse_triple("--ground-colour", ground_colour);
  }
}

void declare_stage_flags(CLI::App& app, StagingFlags& flags) {
  constexpr const char* kGroup = "Stage";
  app.add_option("--centre", flags.centre, "X,Y,Z of the scene that lies at the panel's centre")
      ->group(kGroup);
  app.add_option("--mm-per-unit", flags.stage.mm_per_unit, "size of a scene unit on the glass")
      ->group(kGroup);
  app.add_option("--depth-scale", flags.stage.depth_scale,
                 "depth relative to width and height; 1 is undistorted")
      ->group(kGroup);
  app.add_option("--depth-budget", flags.stage.depth_budget,
                 "how far a fitted scene may leave the glass, in depths of field of the sheet")
      ->group(kGroup)
      ->capture_default_str();
  app.add_option("--fill", flags.stage.fill, "part of the panel that a fitted scene fills")
      ->group(kGroup)
      ->capture_default_str();
  app.add_option("--turn", flags.stage.turn_degrees, "turn the scene about the vertical, degrees")
      ->group(kGroup)
      ->capture_default_str();
}

void declare_surroundings_flags(CLI::App& app, StagingFlags& flags) {
  constexpr const char* kGroup = "Surroundings";
  app.add_option("--background", flags.background, "R,G,B instead of the scene's")->group(kGroup);
  app.add_flag("--sky", flags.surroundings.sky, "a sky instead of a flat background")
      ->group(kGroup);
  app.add_option("--environment", flags.surroundings.environment_file,
                 "latitude-longitude picture instead of a flat background")
      ->group(kGroup);
  app.add_flag("--ground", flags.surroundings.ground, "a plane under the scene")->group(kGroup);
  app.add_option("--ground-colour", flags.ground_colour, "R,G,B of that plane")->group(kGroup);
}

}  // namespace lenticule::player
