// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/cli/staging_flags.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "apps/lenticule/cli/triple.h"
#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::tools {
namespace {

/// Takes "A", or "A:B" for a turn from A to B.
void take_turn(const std::string& text, StagingFlags& flags) {
  auto ends = numbers_from<double, 2>(text, ':');
  if (const auto angle = number_from<double>(text)) ends = {*angle, *angle};
  if (!ends)
    throw Error(ErrorKind::Usage, fmt::format("--turn '{}': not an angle in degrees", text),
                "for example --turn 30, or --turn 0:360 --frames 0:48 for one rotation");
  flags.stage.turn_degrees = (*ends)[0];
  flags.turned_by_degrees = (*ends)[1] - (*ends)[0];
}

}  // namespace

void declare_stage_flags(CLI::App& app, StagingFlags& flags) {
  app.option_defaults()->group("Stage");
  app.add_option_function<std::string>(
         "--up", [&flags](const std::string& name) { flags.load.up = render::up_axis_named(name); },
         "axis of the scene file that points up")
      ->type_name("x|y|z|-x|-y|-z");
  cli::add_triple(
      app, "--centre", "X,Y,Z", [&flags](Vec3 at) { flags.stage.centre = at; },
      "point of the scene that lies at the panel's centre");
  app.add_option("--mm-per-unit", flags.stage.mm_per_unit,
                 "size of a scene unit in the panel plane")
      ->type_name("MM");
  app.add_option("--depth-scale", flags.stage.depth_scale,
                 "depth relative to width and height; 1 is undistorted");
  app.add_option("--depth-budget", flags.stage.depth_budget,
                 "how far a fitted scene may extend before and behind the panel\n"
                 "In depths of field of the sheet.")
      ->capture_default_str();
  app.add_option("--fill", flags.stage.fill, "fraction of the panel that a fitted scene fills")
      ->capture_default_str();
  app.add_option_function<std::string>(
         "--turn", [&flags](const std::string& text) { take_turn(text, flags); },
         "rotate the scene about the vertical axis; 0:360 is one turn over all --frames")
      ->type_name("DEGREES[:DEGREES]")
      ->default_str("0");
  app.add_option("--pitch", flags.stage.pitch_degrees, "see the scene from higher up")
      ->type_name("DEGREES")
      ->default_str(fmt::format("{:g} without a camera", render::kPitchWithoutCamera));
  app.add_flag("--fit", flags.stage.ignore_cameras,
               "ignore the scene's camera and fit the whole scene into the panel");
  app.option_defaults()->group("Options");
}

void declare_surroundings_flags(CLI::App& app, StagingFlags& flags) {
  app.option_defaults()->group("Surroundings");
  cli::add_triple(
      app, "--background", "R,G,B",
      [&flags](Vec3 colour) { flags.surroundings.background = colour; },
      "background colour instead of the scene's");
  app.add_flag("--sky", flags.surroundings.sky, "use a sky as the background");
  app.add_option("--environment", flags.surroundings.environment_file,
                 "latitude-longitude picture to use as the background")
      ->type_name("FILE");
  app.add_flag("--ground", flags.surroundings.ground, "add a plane under the scene");
  const auto take_ground = [&flags](Vec3 colour) {
    flags.surroundings.ground = true;
    flags.surroundings.ground_colour = colour;
  };
  cli::add_triple(app, "--ground-colour", "R,G,B", take_ground, "colour of that plane");
  app.add_flag_callback(
      "--no-ground-shadow", [&flags] { flags.surroundings.ground_shadow = false; },
      "leave out the shadow that a model without lights casts on the ground");
  const auto take_tone_map = [&flags](const std::string& name) {
    flags.surroundings.tone_map = render::tone_map_named(name);
  };
  app.add_option_function<std::string>("--tone-map", take_tone_map,
                                       "tone map of metallic-roughness models")
      ->type_name("none|pbr-neutral|aces")
      ->default_str("pbr-neutral unless the file has lights");
  app.option_defaults()->group("Options");
}

}  // namespace lenticule::tools
