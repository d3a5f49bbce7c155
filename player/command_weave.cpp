// SPDX-License-Identifier: Apache-2.0
// lenticule weave: a quilt, a picture per view, or a frame that was woven for another rig becomes
// the woven frame of a rig.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "frames/weaving/quilt_file.h"
#include "frames/weaving/reweave.h"
#include "optics/trim.h"
#include "player/command.h"
#include "player/interrupt.h"
#include "player/progress.h"

namespace lenticule::player {
namespace {

struct WeaveFlags {
  std::string input;
  std::string rig;
  std::string output;
  std::string filter = "linear";
  std::string fit = "contain";
  std::string grid;
  int views = 0;
  std::optional<double> aspect;
  std::string from_rig;
  std::string quilt;
  std::string crosstalk;
  bool invert = false;
  bool reference = false;
  bool json = false;
};

/// "8x6": columns by rows.
void read_grid(const std::string& text, frames::QuiltLayout& layout) {
  const char* const end = text.data() + text.size();
  const auto columns = std::from_chars(text.data(), end, layout.columns);
  if (columns.ec == std::errc() && columns.ptr != end && *columns.ptr == 'x') {
    const auto rows = std::from_chars(columns.ptr + 1, end, layout.rows);
    if (rows.ec == std::errc() && rows.ptr == end) return;
  }
  throw Error(ErrorKind::Usage, fmt::format("--grid '{}': not columns x rows", text),
              "for example --grid 8x6");
}

/// What the file's name says, overruled by the flags.
frames::QuiltLayout quilt_layout(const WeaveFlags& flags) {
  const auto named = frames::quilt_layout_of_name(flags.input);
  if (!named && flags.grid.empty())
    throw Error(ErrorKind::Usage, fmt::format("{}: how many tiles?", flags.input),
                "name the file *_qs8x6a0.75.png, say --grid 8x6, or give a pattern of views");
  frames::QuiltLayout layout = named.value_or(frames::QuiltLayout{});
  if (!flags.grid.empty()) read_grid(flags.grid, layout);
  if (flags.views != 0) layout.views = flags.views;
  if (flags.aspect) layout.aspect = flags.aspect;
  frames::check_quilt_layout(layout, flags.input);
  return layout;
}

/// The views that are in a frame woven for --from-rig.
frames::ViewSet views_of_other_rig(const WeaveFlags& flags) {
  if (!flags.grid.empty() || flags.aspect || flags.invert)
    throw Error(ErrorKind::Usage, "--from-rig: the input is a woven frame, not a quilt",
                "leave --grid, --aspect and --invert away");
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.from_rig));
  const frames::WovenFrame woven = frames::read_woven(flags.input);
  return frames::views_of_woven(
      woven.view(), model, flags.views > 0 ? flags.views : frames::views_in_woven(model.rig()));
}

frames::ViewSet load_views(const WeaveFlags& flags) {
  if (!flags.from_rig.empty()) return views_of_other_rig(flags);
  if (!frames::FilePattern::looks_like_pattern(flags.input))
    return frames::read_quilt(flags.input, quilt_layout(flags));
  if (!flags.grid.empty())
    throw Error(ErrorKind::Usage, "--grid: the input is a pattern of views, not a quilt");
  frames::ViewSet views = frames::read_views(frames::FilePattern(flags.input), flags.aspect);
  if (flags.views != 0 && flags.views != views.count())
    throw Error(ErrorKind::Input, fmt::format("{}: {} views, where --views says {}", flags.input,
                                              views.count(), flags.views));
  return views;
}

/// As --crosstalk says: nothing, "spot", or a percentage.
frames::ViewSet compensated(frames::ViewSet views, const std::string& text,
                            const optics::Rig& rig) {
  if (text.empty()) return views;
  if (text == "spot")
    return frames::compensate(
        views, frames::crosstalk_of_spot(rig.sheet.spot_sigma.value * views.count()));
  double percent = 0.0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, percent);
  if (read.ec != std::errc() || read.ptr != end)
    throw Error(ErrorKind::Usage, fmt::format("--crosstalk '{}': not a percentage", text),
                "for example --crosstalk 12, or --crosstalk spot");
  return frames::compensate(views, frames::crosstalk_of_percent(percent));
}

int weaving_threads() {
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 16);
}

/// False when interrupted.
bool weave_by_reference(const frames::ViewSet& views, const optics::OpticalModel& model,
                        const frames::WeaveOptions& options, frames::WovenFrame& frame) {
  const frames::Weaver weaver(views, model, options);
  Progress progress("weave", "rows", static_cast<uint64_t>(frame.height()));
  constexpr int kBand = 32;
  for (int j = 0; j < frame.height(); j += kBand) {
    if (interrupted()) return false;
    const int end = std::min(j + kBand, frame.height());
    weaver.weave_rows(j, end, frame);
    progress.update(static_cast<uint64_t>(end));
  }
  progress.finish();
  return true;
}

nlohmann::json report(const WeaveFlags& flags, const frames::ViewSet& views,
                      const frames::WeaveOptions& options, const optics::Rig& rig) {
  return {
      {"output", flags.output},
      {"width", rig.panel.width_px},
      {"height", rig.panel.height_px},
      {"rig", flags.rig},
      {"rig_fingerprint", optics::fingerprint(rig)},
      {"views", views.count()},
      {"view_width", views.width()},
      {"view_height", views.height()},
      {"aspect", views.aspect()},
      {"filter", frames::to_string(options.filter)},
      {"fit", frames::to_string(options.fit)},
      {"crosstalk", flags.crosstalk.empty() ? nlohmann::json() : nlohmann::json(flags.crosstalk)},
      {"reference", flags.reference},
      {"inverted", options.order == frames::ViewOrder::RightToLeft}};
}

void print_report(const nlohmann::json& done) {
  fmt::print("{}: {} x {}, woven from {} views of {} x {}, {}\n", done["output"].get<std::string>(),
             done["width"].get<int>(), done["height"].get<int>(), done["views"].get<int>(),
             done["view_width"].get<int>(), done["view_height"].get<int>(),
             done["filter"].get<std::string>());
}

ExitCode run_weave(const WeaveFlags& flags) {
  const frames::WeaveOptions options{
      .filter = frames::parse_view_filter(flags.filter),
      .fit = frames::parse_picture_fit(flags.fit),
      .order = flags.invert ? frames::ViewOrder::RightToLeft : frames::ViewOrder::LeftToRight};
  frames::check_writable_format(flags.output);
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.rig));
  const frames::ViewSet views = compensated(load_views(flags), flags.crosstalk, model.rig());
  if (interrupted()) return interrupt_exit_code();
  if (!flags.quilt.empty())
    fmt::print(stderr, "{}: the views\n", frames::write_quilt(views, flags.quilt).string());

  const optics::Panel& panel = model.rig().panel;
  frames::WovenFrame frame({.width = panel.width_px, .height = panel.height_px});
  if (!flags.reference)
    frame = frames::weave_fast(views, model, options, weaving_threads());
  else if (!weave_by_reference(views, model, options, frame))
    return interrupt_exit_code();
  frames::write_woven(frame.view(), flags.output);

  const nlohmann::json done = report(flags, views, options, model.rig());
  if (flags.json)
    print_json(done);
  else
    print_report(done);
  return kOk;
}

}  // namespace

Run declare_weave(CLI::App& app) {
  const auto flags = std::make_shared<WeaveFlags>();
  app.add_option(
         "input", flags->input,
         "quilt (NAME_qs<columns>x<rows>a<aspect>.png), pattern of views (%03d.png), or with "
         "--from-rig a woven frame")
      ->required();
  app.add_option("--rig", flags->rig, "rig file")->required();
  app.add_option("-o,--output", flags->output, "woven frame: .png, .tif, .exr or .ppm")->required();
  app.add_option("--filter", flags->filter, "how views mix: nearest, linear or gauss")
      ->capture_default_str();
  app.add_option("--fit", flags->fit, "views of another aspect: contain, cover or stretch")
      ->capture_default_str();
  app.add_option("--grid", flags->grid, "tiles of the quilt, columns x rows: 8x6");
  app.add_option("--from-rig", flags->from_rig,
                 "the input is a frame woven for this rig: it is taken apart into views first");
  app.add_option("--quilt", flags->quilt,
                 "also write the views, as they are woven, as a quilt; its layout is added to the "
                 "name");
  app.add_option(
      "--crosstalk", flags->crosstalk,
      "undo what eyes get of neighbouring views: a percentage, or spot for what the rig's "
      "lens spot lets through");
  app.add_option(
         "--views", flags->views,
         "views in the quilt if the last tiles are empty, or to be taken from a woven frame")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--aspect", flags->aspect, "width / height of a view as it is meant to be seen");
  app.add_flag("--invert", flags->invert, "the first view is the rightmost camera");
  app.add_flag("--reference", flags->reference,
               "weave slowly, in double precision: what the fast weaver is tested against");
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags] { return run_weave(*flags); };
}

}  // namespace lenticule::player
