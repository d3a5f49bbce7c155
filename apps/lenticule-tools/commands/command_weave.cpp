// SPDX-License-Identifier: Apache-2.0
// lenticule weave weaves one set of views into the frame of a rig.

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "frames/weaving/reweave.h"
#include "optics/trim.h"
#include "player/playback/play_statistics.h"
#include "player/process/interrupt.h"
#include "player/process/rig_choice.h"
#include "player/sources/pictures.h"
#include "player/sources/weaving_source.h"

namespace lenticule::tools {
namespace {

struct WeaveFlags {
  std::string input;
  std::string rig;
  std::string output;
  std::string frame;
  player::ContentFlags content;
  player::WeavingFlags weaving;
  std::string quilt;
  bool overwrite = false;
  bool keep_damaged = false;
  bool json = false;
};

player::PictureOptions picture_options(const WeaveFlags& flags) {
  player::PictureOptions options{.drawing_threads = player::all_threads()};
  if (flags.frame.empty()) return options;
  options.frames = player::parse_frame_range(flags.frame);
  if (options.frames->count() != 1)
    throw usage_error("--frame {}: more than one frame", flags.frame)
        .remedy("use lenticule convert for sequences");
  return options;
}

/// Loads the only set of views, or the requested one.
std::unique_ptr<frames::ViewInput> load_views(const WeaveFlags& flags, const optics::Rig& rig) {
  player::PictureOptions options = picture_options(flags);
  options.rig = &rig;
  const player::SourceSpec source = parse_source(flags.input, flags.content);
  const player::Content content =
      identify_by_pixels(source, optics::fingerprint(rig), std::nullopt, true, true);
  if (content.kind == player::Content::Kind::Woven) {
    if (source.kind == player::SourceKind::Pictures)
      (void)frames::probe_picture(flags.input, frames::PictureUse::Views);
    throw usage_error("{}: {}", flags.input,
                      source.kind == player::SourceKind::Sequence
                          ? "its frames are woven already"
                          : "the layout of the views is unknown")
        .remedy(
            "name the file *_qs8x6a0.75.png, use --grid 8x6 (1x1 for an ordinary picture or "
            "film), --stereo, --depth or --from-rig, or give a pattern of views");
  }
  std::unique_ptr<frames::ViewInput> input = open_views(content, options);
  if (input->frame_count() != uint64_t{1} && !options.frames)
    throw usage_error("{}: more than one frame", flags.input)
        .remedy("choose one with --frame N, or use lenticule convert");
  player::await_first(*input, flags.input);
  return input;
}

nlohmann::json report(const WeaveFlags& flags, const frames::ViewSet& views,
                      const frames::WeaveOptions& options, const optics::Rig& rig) {
  return {{"output", flags.output},
          {"width", rig.panel.width_px},
          {"height", rig.panel.height_px},
          {"rig", flags.rig},
          {"rig_fingerprint", optics::fingerprint(rig)},
          {"views", views.count()},
          {"view_width", views.width()},
          {"view_height", views.height()},
          {"aspect", views.aspect()},
          {"filter", frames::to_string(frames::view_filter(options, rig.sheet, views.count()))},
          {"fit", frames::to_string(options.fit)},
          {"crosstalk", flags.weaving.crosstalk.empty() ? nlohmann::json()
                                                        : nlohmann::json(flags.weaving.crosstalk)},
          {"inverted", flags.content.invert}};
}

void print_report(const nlohmann::json& done) {
  print_out("{}: {} x {}, woven from {} views of {} x {}, {}\n", done["output"].get<std::string>(),
            done["width"].get<int>(), done["height"].get<int>(), done["views"].get<int>(),
            done["view_width"].get<int>(), done["view_height"].get<int>(),
            done["filter"].get<std::string>());
}

void refuse_damage(frames::ViewInput& input, const WeaveFlags& flags) {
  const frames::FrameDamage damage = player::await_damage(input);
  if (damage.any() && !flags.keep_damaged)
    throw failed_error("{}: {}", flags.input, player::damage_text(damage))
        .remedy("use --keep-damaged to weave a readable frame instead of a damaged one");
}

ExitCode run_weave(const WeaveFlags& flags) {
  const frames::WeaveOptions options = weave_options(flags.weaving);
  frames::check_writable_format(flags.output);
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.rig));
  const optics::Panel& panel = model.rig().panel;
  const frames::FrameGeometry geometry{.width = panel.width_px, .height = panel.height_px};
  require_replaceable_pictures(
      {.target = flags.output, .range = {.begin = 0, .end = 1}, .overwrite = flags.overwrite},
      geometry, [&flags](uint64_t) { return flags.output; });
  const std::unique_ptr<frames::ViewInput> input = load_views(flags, model.rig());
  const frames::ViewSet& given = input->views();
  const auto crosstalk = player::crosstalk_of(flags.weaving.crosstalk, model.rig(), given.count());
  std::optional<frames::ViewSet> compensated;
  const frames::ViewSet& views =
      crosstalk ? compensated.emplace(frames::compensate(given, *crosstalk)) : given;
  if (player::interrupted()) return player::interrupt_exit_code();
  if (!flags.quilt.empty())
    say("{}: the views\n", frames::write_quilt(views, flags.quilt).string());

  const frames::WovenFrame frame = frames::weave_fast(views, model, options, player::all_threads());
  const nlohmann::json done = report(flags, views, options, model.rig());
  refuse_damage(*input, flags);
  frames::write_woven(frame.view(), flags.output);
  print_result(done, flags.json, print_report);
  return kOk;
}

}  // namespace

cli::Run declare_weave(CLI::App& app) {
  const auto flags = std::make_shared<WeaveFlags>();
  app.add_option(
         "VIEWS", flags->input,
         "quilt (NAME_qs8x6a0.75.png), pattern of views (%03d.png), or another set of views\n"
         "Two eyes (NAME_sbs.png), a picture with depth (NAME_rgbd.png), one frame of a video "
         "or of FILE.lts, or with --from-rig a woven frame. A quilt's name states columns, "
         "rows and aspect.")
      ->required();
  cli::declare_rig_flag(app, flags->rig);
  cli::add_option(app, "-o,--output FILE", flags->output, "woven frame: .png, .tif, .exr or .ppm")
      ->required();
  cli::add_option(app, "--frame N", flags->frame, "which frame of a sequence");
  cli::declare_content_flags(app, flags->content);
  cli::declare_weaving_flags(app, flags->weaving);
  cli::add_option(app, "--quilt FILE", flags->quilt,
                  "also write the woven views as a quilt; its layout is added to the name");
  app.add_flag("--overwrite", flags->overwrite, kOverwriteHelp);
  app.add_flag("--keep-damaged", flags->keep_damaged,
               "also weave from a damaged input\nAnother frame may replace the requested one.");
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags] {
    flags->rig = player::choose_rig({.given = flags->rig}).file;
    return run_weave(*flags);
  };
}

}  // namespace lenticule::tools
