// SPDX-License-Identifier: Apache-2.0
// lenticule depth measures how deep a scene is on a panel, in depths of field of its lens sheet.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <map>
#include <memory>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/rig_choice.h"
#include "render/depth_budget/prefilter.h"
#include "render/scene/scene.h"

namespace lenticule::tools {
namespace {

struct DepthFlags {
  std::string scene;
  std::string rig;
  std::string frames = "0:1";
  std::string fps = "30";
  StagingFlags staging;
  int threads = 0;
  std::string picture;
  bool json = false;
};

struct Measured {
  render::DepthHistogram histogram;
  uint64_t frames = 0;
  double obliquest_mm = 0.0;  ///< depth of field at the panel's left and right edge
};

/// Returns the depth of field at the edges, for rays to the middle of the viewing line.
double depth_of_field_at_the_edge(const optics::OpticalModel& model) {
  const optics::Rig& rig = model.rig();
  const double half_mm = rig.panel.width_px * rig.panel.pixel_width.value / 2.0;
  const double aside_mm = half_mm + std::abs(rig.viewing.centre.value);
  const double tan_x = aside_mm / rig.viewing.distance.value;  // 0 for parallel zones
  return render::DepthOfField(model).along_mm(tan_x, 0.0);
}

/// Measures the scene; its picture is that of the first frame.
Measured measure(const DepthFlags& flags, const optics::OpticalModel& model) {
  const player::FrameRange range = player::parse_frame_range(flags.frames);
  const SceneSequence scenes(flags.scene, frames::parse_rate(flags.fps), flags.staging.load);
  scenes.require(range);
  const StageSequence stages(scenes.at(scenes.reference_frame()), render::canvas_of(model),
                             flags.staging.stage, flags.staging.turned_by_degrees);
  const optics::Panel& panel = model.rig().panel;
  frames::WovenFrame picture({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  Measured measured{render::DepthHistogram{.views = model.rig().sheet.pitch.value}, 0,
                    depth_of_field_at_the_edge(model)};
  for (uint64_t frame = range.begin; frame < range.end && !player::interrupted(); ++frame) {
    const render::SceneDescription description = scenes.at(frame);
    const render::Stage stage = stages.at(description, range.part_before(frame));
    const render::Scene scene(description, stage, flags.staging.surroundings, flags.threads);
    const bool drawn = frame == range.begin && !flags.picture.empty();
    measured.histogram +=
        render::measure_depth(model, scene, flags.threads, {.map = drawn ? &picture : nullptr});
    ++measured.frames;
    if (drawn) frames::write_woven(picture.view(), flags.picture);
  }
  return measured;
}

nlohmann::json bins_json(const render::DepthHistogram& histogram) {
  nlohmann::json bins = nlohmann::json::array();
  for (size_t bin = 0; bin < histogram.bins.size(); ++bin)
    if (histogram.bins[bin] > 0)
      bins.push_back({{"begin", render::DepthHistogram::bin_begin(bin)},
                      {"end", render::DepthHistogram::bin_begin(bin + 1)},
                      {"subpixels", histogram.bins[bin]}});
  return bins;
}

/// Returns the report; numbers that are not finite are written as null.
nlohmann::json report_json(const DepthFlags& flags, const optics::OpticalModel& model,
                           const Measured& measured) {
  const render::DepthHistogram& h = measured.histogram;
  const auto share = [&](uint64_t count) {
    return static_cast<double>(count) / static_cast<double>(std::max<uint64_t>(h.subpixels(), 1));
  };
  const double straight_mm = model.depth_of_field_mm();
  return {{"scene", flags.scene},
          {"rig", flags.rig},
          {"rig_fingerprint", optics::fingerprint(model.rig())},
          {"frames", measured.frames},
          {"subpixels", h.subpixels()},
          {"depth_of_field_mm", straight_mm},
          {"depth_of_field_at_edge_mm", measured.obliquest_mm},
          {"views", model.rig().sheet.pitch.value},
          {"nearest_mm", h.nearest_mm},
          {"farthest_mm", h.farthest_mm},
          {"share_within", share(h.within)},
          {"share_at_glass", share(h.at_panel)},
          {"share_in_front", share(h.in_front)},
          {"share_behind", share(h.behind)},
          {"share_nothing", share(h.nothing)},
          {"bins", bins_json(h)}};
}

void print_line(const char* what, double share, const std::string& where) {
  print_out("{:<26} {:>6.2f} %   {}\n", what, 100.0 * share, where);
}

/// Prints the histogram in bins of a half up to two depths of field and of one beyond, for
/// readability.
void print_histogram(const nlohmann::json& r) {
  const auto group_of = [](double begin) {
    return begin >= -2.0 && begin < 2.0 ? std::floor(2.0 * begin) / 2.0 : std::floor(begin);
  };
  std::map<double, double> shares;
  for (const auto& bin : r["bins"])
    shares[group_of(bin["begin"].get<double>())] +=
        bin["subpixels"].get<double>() / r["subpixels"].get<double>();
  print_out("\n  depths of field    share\n");
  for (const auto& [begin, share] : shares)
    print_out("  {:>5.1f} to {:>5.1f}  {:>6.2f} %  {}\n", begin,
              begin + (begin >= -2.0 && begin < 2.0 ? 0.5 : 1.0), 100.0 * share,
              std::string(static_cast<size_t>(std::lround(50.0 * share)), '#'));
}

void print_report(const nlohmann::json& r) {
  const auto number = [&](const char* key) { return r[key].get<double>(); };
  const double field_mm = number("depth_of_field_mm");
  print_out(
      "depth of field             {:>6.2f} mm, {:.2f} mm at the panel's left and right edge\n",
      field_mm, number("depth_of_field_at_edge_mm"));
  if (std::isfinite(number("nearest_mm")))
    print_out("content                    from z = {:.1f} to {:.1f} mm: {:.2f} and {:.2f} depths\n",
              number("nearest_mm"), number("farthest_mm"), number("nearest_mm") / field_mm,
              number("farthest_mm") / field_mm);
  print_line("in front of it", number("share_in_front"), "blurred over lenses");
  print_line("within it", number("share_within"), "sharp");
  print_line("- at the panel", number("share_at_glass"),
             fmt::format("within {:.2f} mm: the same in all views", field_mm / number("views")));
  print_line("behind it", number("share_behind"), "blurred over lenses");
  print_line("nothing", number("share_nothing"), "");
  print_histogram(r);
}

ExitCode run_depth(DepthFlags& flags) {
  if (!flags.picture.empty()) frames::check_writable_format(flags.picture);
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.rig));
  const Measured measured = measure(flags, model);
  print_result(report_json(flags, model, measured), flags.json, print_report);
  return player::interrupt_exit_code();
}

}  // namespace

cli::Run declare_depth(CLI::App& app) {
  auto flags = std::make_shared<DepthFlags>();
  app.add_option("SCENE", flags->scene, "as for render")->required();
  cli::declare_rig_flag(app, flags->rig);
  cli::add_option(app, "--frames A:B|N", flags->frames,
                  "measure frames A to B - 1; N measures only frame N");
  cli::add_option(app, "--fps RATE", flags->fps, "frames per second of the animation");
  cli::add_option(app, "--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024));
  cli::add_option(
      app, "--picture FILE", flags->picture,
      "picture of how deep the first frame is\n"
      "Grey within the depth of field, white at the panel, yellow to red in front and cyan "
      "to blue behind, up to eight times as far.");
  app.add_flag("--json", flags->json, "print as JSON");
  declare_stage_flags(app, flags->staging);
  declare_surroundings_flags(app, flags->staging);
  return [flags]() -> ExitCode {
    flags->rig = player::choose_rig({.given = flags->rig}).file;
    return run_depth(*flags);
  };
}

}  // namespace lenticule::tools
