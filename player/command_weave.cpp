// SPDX-License-Identifier: Apache-2.0
// lenticule weave: a quilt, or a picture per view, becomes the woven frame of a rig.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>

#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/weave.h"
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
  bool invert = false;
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

frames::ViewSet load_views(const WeaveFlags& flags) {
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
          {"filter", frames::to_string(options.filter)},
          {"fit", frames::to_string(options.fit)},
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
  const frames::ViewSet views = load_views(flags);
  const frames::Weaver weaver(views, model, options);

  frames::WovenFrame frame(weaver.geometry());
  Progress progress("weave", "rows", static_cast<uint64_t>(frame.height()));
  constexpr int kBand = 32;
  for (int j = 0; j < frame.height(); j += kBand) {
    if (interrupted()) return interrupt_exit_code();
    const int end = std::min(j + kBand, frame.height());
    weaver.weave_rows(j, end, frame);
    progress.update(static_cast<uint64_t>(end));
  }
  frames::write_woven(frame.view(), flags.output);
  progress.finish();

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
  app.add_option("input", flags->input,
                 "quilt (NAME_qs<columns>x<rows>a<aspect>.png) or pattern of views (%03d.png)")
      ->required();
  app.add_option("--rig", flags->rig, "rig file")->required();
  app.add_option("-o,--output", flags->output, "woven frame: .png, .tif, .exr or .ppm")->required();
  app.add_option("--filter", flags->filter, "how views mix: nearest, linear or gauss")
      ->capture_default_str();
  app.add_option("--fit", flags->fit, "views of another aspect: contain, cover or stretch")
      ->capture_default_str();
  app.add_option("--grid", flags->grid, "tiles of the quilt, columns x rows: 8x6");
  app.add_option("--views", flags->views, "views in the quilt if the last tiles are empty")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--aspect", flags->aspect, "width / height of a view as it is meant to be seen");
  app.add_flag("--invert", flags->invert, "the first view is the rightmost camera");
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags] { return run_weave(*flags); };
}

}  // namespace lenticule::player
