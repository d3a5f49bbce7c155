// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/cli/render_flags.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "apps/lenticule-tools/cli/soft_light_flags.h"
#include "apps/lenticule/cli/content_flags.h"
#include "base/error.h"
#include "player/process/rig_choice.h"
#include "player/sources/source_spec.h"
#include "render/depth_budget/prefilter.h"
#include "render/methods/adaptive/method_adaptive.h"

namespace lenticule::tools {
namespace {

/// Flags that the user gave.
struct Given {
  bool error, psnr, prefilter_samples;
};

/// Refuses flags that would have no effect.
void refuse_idle_flags(const RenderFlags& flags, const Given& given) {
  if ((given.error || given.psnr) && flags.method != "adaptive")
    throw Error(ErrorKind::Usage,
                fmt::format("--{}: method {} tolerates no error", given.error ? "error" : "psnr",
                            flags.method),
                "--method adaptive does");
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

std::function<void()> declare_render_flags(CLI::App& app, RenderFlags& flags) {
  app.add_option("SCENE", flags.scene,
                 "scene file, numbered files ('demo-%02d.nff'), or builtin:NAME[:SIZE]")
      ->required();
  CLI::Option* const rig = cli::declare_rig_flag(app, flags.rig);
  app.add_option("--frames", flags.frames, "render frames A to B - 1; N renders only frame N")
      ->capture_default_str()
      ->type_name("A:B|N");
  app.add_option("--fps", flags.fps, "frames per second of the animation")
      ->type_name("RATE")
      ->capture_default_str();
  app.add_option("--method", flags.method, "how subpixels are rendered")
      ->type_name("full|lens-view|interpolate|temporal|hybrid|adaptive")
      ->capture_default_str();
  CLI::Option* const error =
      app.add_option("--error", flags.options.tolerated_error,
                     "error that adaptive may make in most subpixels; 0: full")
          ->type_name("CODE-VALUES")
          ->capture_default_str();
  CLI::Option* const psnr = app.add_option("--psnr", flags.least_psnr_db,
                                           "least PSNR of each frame of method adaptive: 40\n"
                                           "Against method full, proven with 99 % confidence.")
                                ->type_name("DB");

  app.option_defaults()->group("Quality");
  app.add_option("--samples", flags.options.samples, "rays per subpixel, inside its area")
      ->capture_default_str();
  app.add_option("--prefilter", flags.prefilter,
                 "average over the beam of each subpixel\n"
                 "depth: outside the sheet's depth of field; beam: everywhere; exhaustive: "
                 "everywhere, slowly.")
      ->type_name("off|depth|beam|exhaustive")
      ->capture_default_str();
  CLI::Option* const prefilter_samples =
      app.add_option("--prefilter-samples", flags.options.prefilter_samples,
                     "largest number of rays per averaged subpixel")
          ->capture_default_str();
  app.add_option("--max-depth", flags.options.max_depth,
                 "largest number of reflections and refractions")
      ->capture_default_str();
  app.add_option("--threads", flags.options.threads,
                 "0 means all cores\nWith a ring, one of four or more is left to the player.")
      ->capture_default_str();

  app.option_defaults()->group("Walls");
  app.add_option("--wall", flags.wall,
                 "instead of --rig: render one scene for all panels of a wall\n"
                 "Each into a file of its own.")
      ->type_name("WALL.toml")
      ->excludes(rig);
  app.add_option("--panel", flags.panel, "render only this panel of the wall")->type_name("NAME");
  declare_stage_flags(app, flags.staging);
  app.add_option("--camera", flags.camera,
                 "file with one camera per line: from, at, up, field of view")
      ->group("Stage")
      ->type_name("FILE");
  declare_surroundings_flags(app, flags.staging);
  declare_soft_light_flags(app, flags.options.soft);
  return [&flags, error, psnr, prefilter_samples] {
    flags.options.prefilter = render::prefilter_named(flags.prefilter);
    const Given given{.error = error->count() > 0,
                      .psnr = psnr->count() > 0,
                      .prefilter_samples = prefilter_samples->count() > 0};
    refuse_idle_flags(flags, given);
    if (flags.wall.empty()) flags.rig = player::choose_rig({.given = flags.rig}).file;
    if (!given.psnr) return;
    const double tolerated = flags.options.tolerated_error;
    render::promise_psnr(flags.least_psnr_db, flags.options);
    if (given.error) flags.options.tolerated_error = tolerated;
  };
}

}  // namespace lenticule::tools
