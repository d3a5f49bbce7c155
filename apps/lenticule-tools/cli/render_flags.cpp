// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/cli/render_flags.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/numbers.h"
#include "player/process/rig_choice.h"
#include "player/sources/source_spec.h"
#include "render/depth_budget/prefilter.h"
#include "render/methods/method.h"

namespace lenticule::tools {

namespace {

/// Takes "A", or "A:B" for a turn from A to B.
void take_turn(const std::string& text, StagingFlags& flags) {
  auto ends = numbers_from<double, 2>(text, ':');
  if (const auto angle = number_from<double>(text)) ends = {*angle, *angle};
  if (!ends)
    throw usage_error("--turn '{}': not an angle in degrees", text)
        .remedy("for example --turn 30, or --turn 0:360 --frames 0:48 for one rotation");
  flags.stage.turn_degrees = (*ends)[0];
  flags.turned_by_degrees = (*ends)[1] - (*ends)[0];
}

/// Flags that the user gave.
struct Given {
  bool error, psnr, prefilter_samples;
};

/// Refuses flags that would have no effect.
void refuse_idle_flags(const RenderFlags& flags, const Given& given) {
  if ((given.error || given.psnr) && flags.method != "adaptive")
    throw usage_error("--{}: method {} tolerates no error", given.error ? "error" : "psnr",
                      flags.method)
        .remedy("--method adaptive does");
  if (given.prefilter_samples && flags.options.prefilter == render::Prefilter::Off)
    throw Error(ErrorKind::Usage, "--prefilter-samples: nothing is averaged without --prefilter",
                "for example --prefilter beam");
  if (flags.staging.stage.ignore_cameras && !flags.camera.empty())
    throw Error(ErrorKind::Usage, "--fit: ignores the camera that --camera names",
                "give one of the two");
  if (flags.staging.turned_by_degrees != 0.0 &&
      player::parse_frame_range(flags.frames).count() == 1)
    throw Error(ErrorKind::Usage, "--turn: one frame cannot turn from one angle to another",
                "for example --turn 0:360 --frames 0:48, or --turn 30");
  if (flags.wall.empty() && !flags.panel.empty())
    throw Error(ErrorKind::Usage, "--panel: names a panel of a wall", "give --wall WALL, too");
}

}  // namespace

CLI::Option* declare_model_flags(CLI::App& app, render::LoadOptions& load) {
  app.option_defaults()->group("Model ('lenticule scene show' lists names and numbers)");
  const auto add = [&](const char* flag, std::string& to, const char* text,
                       const char* type = "NAME|NUMBER") {
    return app.add_option(flag, to, text)->type_name(type);
  };
  add("--scene", load.choices.scene, "scene of a glTF file instead of the one that the file names");
  add("--animation", load.choices.animation,
      "animation that is played instead of the first\nnone: the model at rest; all: all at once.",
      "NAME|NUMBER|none|all");
  add("--variant", load.choices.variant, "variant of the materials of a glTF file");
  CLI::Option* const camera = add("--scene-camera", load.choices.camera,
                                  "camera that places the scene instead of the file's first");
  cli::add_option_function(
      app, "--up x|y|z|-x|-y|-z",
      [&load](const std::string& name) { load.up = render::up_axis_named(name); },
      "axis of the scene file that points up");
  app.add_flag("--any-format", load.any_format,
               "also read models in formats whose reader crashes often: MD2, X, 3MF, ...");
  app.option_defaults()->group("Options");
  return camera;
}

void declare_stage_flags(CLI::App& app, StagingFlags& flags) {
  CLI::Option* const camera = declare_model_flags(app, flags.load);
  app.option_defaults()->group("Stage");
  cli::add_triple(
      app, "--centre X,Y,Z", [&flags](Vec3 at) { flags.stage.centre = at; },
      "point of the scene that lies at the panel's centre");
  cli::add_option(app, "--mm-per-unit MM", flags.stage.mm_per_unit,
                  "size of a scene unit in the panel plane");
  app.add_option("--depth-scale", flags.stage.depth_scale,
                 "depth relative to width and height; 1 is undistorted");
  cli::add_option(app, "--depth-budget", flags.stage.depth_budget,
                  "how far a fitted scene may extend before and behind the panel\n"
                  "In depths of field of the sheet.");
  app.add_flag("--whole-depth", flags.stage.whole_depth,
               "fit the depth of floor, walls and backdrop, too, not only of what stands on them");
  cli::add_option(app, "--fill", flags.stage.fill,
                  "fraction of the panel that a fitted scene fills");
  cli::add_option_function(
      app, "--turn DEGREES[:DEGREES]",
      [&flags](const std::string& text) { take_turn(text, flags); },
      "rotate the scene about the vertical axis; 0:360 is one turn over all --frames")
      ->default_str("0");
  cli::add_option(app, "--pitch DEGREES", flags.stage.pitch_degrees, "see the scene from higher up")
      ->default_str(fmt::format("{:g} without a camera", render::kPitchWithoutCamera));
  app.add_flag("--fit", flags.stage.ignore_cameras,
               "ignore the scene's camera and fit the whole scene into the panel")
      ->excludes(camera);
  app.option_defaults()->group("Options");
}

void declare_surroundings_flags(CLI::App& app, StagingFlags& flags) {
  app.option_defaults()->group("Surroundings");
  cli::add_triple(
      app, "--background R,G,B", [&flags](Vec3 colour) { flags.surroundings.background = colour; },
      "background colour instead of the scene's");
  app.add_flag("--sky", flags.surroundings.sky, "use a sky as the background");
  cli::add_option(app, "--environment FILE", flags.surroundings.environment_file,
                  "latitude-longitude picture to use as the background");
  app.add_flag("--ground", flags.surroundings.ground, "add a plane under the scene");
  const auto take_ground = [&flags](Vec3 colour) {
    flags.surroundings.ground = true;
    flags.surroundings.ground_colour = colour;
  };
  cli::add_triple(app, "--ground-colour R,G,B", take_ground, "colour of that plane");
  app.add_flag_callback(
      "--no-ground-shadow", [&flags] { flags.surroundings.ground_shadow = false; },
      "leave out the shadow that a model without lights casts on the ground");
  const auto take_tone_map = [&flags](const std::string& name) {
    flags.surroundings.tone_map = render::tone_map_named(name);
  };
  cli::add_option_function(app, "--tone-map none|pbr-neutral|aces", take_tone_map,
                           "tone map of metallic-roughness models")
      ->default_str("pbr-neutral unless the file has lights");
  app.option_defaults()->group("Options");
}

void declare_soft_light_flags(CLI::App& app, render::SoftLight& soft) {
  app.option_defaults()->group("Soft light (rays for each shaded point)");
  CLI::Option* shadows =
      app.add_option("--soft-shadows", soft.shadow_samples, "rays to each area light");
  cli::add_option(app, "--light-size MM", soft.light_radius_mm,
                  "radius of lights with a position, in the panel plane; 0: hard shadows")
      ->needs(shadows);
  cli::add_option(app, "--sun-size DEGREES", soft.sun_radius_degrees,
                  "radius of lights at infinity; 0: hard shadows")
      ->needs(shadows);
  CLI::Option* occlusion =
      app.add_option("--occlusion", soft.occlusion_samples,
                     "rays that measure how much of the ambient light is occluded");
  cli::add_option(app, "--occlusion-distance MM", soft.occlusion_distance_mm,
                  "largest distance of occluders, in the panel plane; inf: unlimited")
      ->needs(occlusion);
  app.add_option("--environment-light", soft.environment_samples,
                 "rays to the environment, which then lights the scene\n"
                 "Instead of the ambient light.")
      ->excludes(occlusion);
  app.option_defaults()->group("Options");
}

std::function<void()> declare_render_flags(CLI::App& app, RenderFlags& flags) {
  app.add_option("SCENE", flags.scene,
                 "scene file, numbered files ('demo-%02d.nff'), or builtin:NAME[:SIZE]")
      ->required();
  CLI::Option* const rig = cli::declare_rig_flag(app, flags.rig);
  cli::add_option(app, "--frames A:B|N", flags.frames,
                  "render frames A to B - 1; N renders only frame N");
  cli::add_option(app, "--fps RATE", flags.fps, "frames per second of the animation");
  cli::add_option(app, "--method full|lens-view|interpolate|temporal|hybrid|adaptive", flags.method,
                  "how subpixels are rendered");
  CLI::Option* const error =
      cli::add_option(app, "--error CODE-VALUES", flags.options.tolerated_error,
                      "error that adaptive may make in most subpixels; 0: full");
  CLI::Option* const psnr = cli::add_option(app, "--psnr DB", flags.least_psnr_db,
                                            "least PSNR of each frame of method adaptive: 40\n"
                                            "Against method full, proven with 99 % confidence.")
                                ->default_str("")
                                ->excludes(error);

  app.option_defaults()->group("Quality");
  cli::add_option(app, "--samples", flags.options.samples, "rays per subpixel, inside its area");
  cli::add_option(app, "--prefilter off|depth|beam|exhaustive", flags.prefilter,
                  "average over the beam of each subpixel\n"
                  "depth: outside the sheet's depth of field; beam: everywhere; exhaustive: "
                  "everywhere, slowly.");
  CLI::Option* const prefilter_samples =
      cli::add_option(app, "--prefilter-samples", flags.options.prefilter_samples,
                      "largest number of rays per averaged subpixel");
  cli::add_option(app, "--max-depth", flags.options.max_depth,
                  "largest number of reflections and refractions");
  cli::add_option(app, "--threads", flags.options.threads,
                  "0 means all cores\nWith a ring, one of four or more is left to the player.");

  app.option_defaults()->group("Walls");
  cli::add_option(app, "--wall WALL.toml", flags.wall,
                  "instead of --rig: render one scene for all panels of a wall\n"
                  "Each into a file of its own.")
      ->excludes(rig);
  cli::add_option(app, "--panel NAME", flags.panel, "render only this panel of the wall");
  declare_stage_flags(app, flags.staging);
  cli::add_option(app, "--camera FILE", flags.camera,
                  "file with one camera per line: from, at, up, field of view")
      ->group("Stage")
      ->excludes(app.get_option("--scene-camera"));
  declare_surroundings_flags(app, flags.staging);
  declare_soft_light_flags(app, flags.options.soft);
  return [&flags, error, psnr, prefilter_samples] {
    flags.options.prefilter = render::prefilter_named(flags.prefilter);
    const Given given{.error = error->count() > 0,
                      .psnr = psnr->count() > 0,
                      .prefilter_samples = prefilter_samples->count() > 0};
    refuse_idle_flags(flags, given);
    if (flags.wall.empty()) flags.rig = player::choose_rig({.given = flags.rig}).file;
    if (given.psnr) render::promise_psnr(flags.least_psnr_db, flags.options);
  };
}
}  // namespace lenticule::tools
