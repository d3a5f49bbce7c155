// SPDX-License-Identifier: Apache-2.0
// lenticule bench error summarises the frames of a scenario for each method, prints the tables and
// draws the plot, and has the flags.

#include "apps/lenticule-bench/render/bench_error.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <set>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/svg_plot.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "apps/lenticule-tools/cli/render_flags.h"
#include "base/print.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/methods/method.h"

namespace lenticule::bench {

namespace {

using nlohmann::json;

double sum(const std::vector<double>& list) {
  double total = 0.0;
  for (const double value : list) total += value;
  return total;
}

json mean(const std::vector<double>& list) {
  return list.empty() ? json() : json(sum(list) / static_cast<double>(list.size()));
}

json largest(const std::vector<double>& list) {
  return list.empty() ? json() : json(*std::ranges::max_element(list));
}

json smallest(const std::vector<double>& list) {
  return list.empty() ? json() : json(*std::ranges::min_element(list));
}

/// Returns the values of all eyes in all frames; `from` skips frames without a previous one.
std::vector<double> seen(const json& frames, const char* key, size_t from = 0) {
  std::vector<double> list;
  for (size_t n = from; n < frames.size(); ++n)
    for (const json& eye : frames[n]["eyes"])
      if (!eye[key].is_null()) list.push_back(eye[key].get<double>());
  return list;
}

json ratio(double part, double whole) { return whole > 0.0 ? json(part / whole) : json(); }

std::vector<double> without_first(std::vector<double> list) {
  if (!list.empty()) list.erase(list.begin());
  return list;
}

json mean_psnr(const std::vector<double>& mses) {
  std::vector<double> decibels;
  for (const double mse : mses)
    if (mse > 0.0) decibels.push_back(psnr_or_null(mse).get<double>());
  return mean(decibels);
}

/// Collects the frames that have a bound.
struct Bounds {
  int frames = 0, within = 0;
  double largest_share = 0.0, largest_excess = 0.0, sum = 0.0;

  void add(const json& of) {
    for (const json& frame : of) {
      if (!frame.contains("bound") || !frame.contains("share_over_e")) continue;
      const double share = frame["share_over_e"], bound = frame["bound"];
      ++frames;
      within += share <= bound ? 1 : 0;
      largest_share = std::max(largest_share, share);
      largest_excess = std::max(largest_excess, share - bound);
      sum += bound;
    }
  }
  [[nodiscard]] json figures() const {
    if (frames == 0) return {};
    return {{"frames", frames},
            {"within_percent", 100.0 * within / frames},
            {"largest_share", largest_share},
            {"largest_excess", largest_excess},
            {"mean_bound", sum / frames}};
  }
};

}  // namespace

json saving(double seconds, double reference) {
  return reference > 0.0 ? json(1.0 - seconds / reference) : json();
}

std::vector<double> values_of(const json& frames, const char* key) {
  std::vector<double> list;
  for (const json& frame : frames)
    if (frame.contains(key)) list.push_back(frame[key].get<double>());
  return list;
}

void add_times(json& method, const json& reference_frames) {
  const json& frames = method["frames"];
  const std::vector<double> wall = values_of(frames, "wall_s");
  const std::vector<double> wall_reference = values_of(reference_frames, "wall_s");
  const double seconds = sum(wall);
  const double subpixels = sum(values_of(frames, "subpixels"));
  const double later = sum(without_first(wall));
  method["seconds_per_frame"] = mean(wall);
  method["first_s"] = wall.empty() ? json() : json(wall.front());
  method["later_s"] = mean(without_first(wall));
  method["later_build_s"] = mean(without_first(values_of(frames, "build_s")));
  method["of_full"] = ratio(seconds, sum(wall_reference));
  method["saved"] = saving(seconds, sum(wall_reference));
  method["later_saved"] = saving(later, sum(without_first(wall_reference)));
  const std::vector<double> cpu = values_of(frames, "cpu_s");
  const std::vector<double> cpu_reference = values_of(reference_frames, "cpu_s");
  method["cpu_of_full"] = ratio(sum(cpu), sum(cpu_reference));
  method["later_cpu_of_full"] = ratio(sum(without_first(cpu)), sum(without_first(cpu_reference)));
  method["rays_per_subpixel"] = ratio(sum(values_of(frames, "rays")), subpixels);
}

void add_errors(json& method) {
  const json& frames = method["frames"];
  const std::vector<double> mses = values_of(frames, "mse");
  method["psnr_mean_db"] = mean_psnr(mses);
  method["psnr_worst_db"] = psnr_or_null(mses.empty() ? 0.0 : *std::ranges::max_element(mses));
  const json view = largest(values_of(frames, "worst_view_mse"));
  method["worst_view_psnr_db"] = psnr_or_null(view.is_null() ? 0.0 : view.get<double>());
  method["max"] = largest(values_of(frames, "max"));
  for (const char* share : {"share_over_e", "share_over_8", "share_over_32"})
    method[share] = mean(values_of(frames, share));
  Bounds bounds;
  bounds.add(frames);
  method["bound"] = bounds.figures();
}

namespace {

void add_seen(json& method) {
  const json& frames = method["frames"];
  method["ssim_mean"] = mean(seen(frames, "ssim"));
  method["ssim_worst"] = smallest(seen(frames, "ssim"));
  method["flip_mean"] = mean(seen(frames, "flip_mean"));
  method["flip_p99_worst"] = largest(seen(frames, "flip_p99"));
  method["flicker_mean"] = mean(seen(frames, "flicker_mean", 1));
  method["flicker_largest"] = largest(seen(frames, "flicker_largest", 1));
}

}  // namespace

json bound_of_all(const json& scenarios) {
  Bounds bounds;
  for (const json& scenario : scenarios)
    for (const json& method : scenario["methods"])
      if (method.contains("frames")) bounds.add(method["frames"]);
  return bounds.figures();
}

void summarize_errors(json& scenario, const json& tachyon) {
  const json reference_frames = scenario["methods"][0]["frames"];
  scenario["tachyon"] = tachyon;
  for (json& method : scenario["methods"]) {
    if (method["missing"].get<bool>()) continue;
    add_times(method, reference_frames);
    method["over_copy"] = ratio(method["seconds_per_frame"].get<double>(), scenario["copy_s"]);
    // Both ratios come from interleaved runs, so their quotient does not depend on other load.
    method["over_tachyon"] = nullptr;
    if (tachyon.contains("ours_over_theirs") && !method["of_full"].is_null())
      method["over_tachyon"] =
          ratio(tachyon["ours_over_theirs"].get<double>(), method["of_full"].get<double>());
    if (&method == &scenario["methods"][0]) continue;
    add_errors(method);
    add_seen(method);
  }
}

// Prints the tables of `lenticule bench error` and draws its plot.

namespace {

void print_times(const json& methods) {
  constexpr Column kColumns[] = {{"time", "name"},
                                 {"ms/frame", "seconds_per_frame", "{:.2f}", 1e3},
                                 {"first", "first_s", "{:.2f}", 1e3},
                                 {"later", "later_s", "{:.2f}", 1e3},
                                 {"outside", "later_build_s", "{:.2f}", 1e3},
                                 {"saved", "saved", "{:.0f} %", 100.0},
                                 {"later", "later_saved", "{:.0f} %", 100.0},
                                 {"CPU", "cpu_of_full", "{:.0f} %", 100.0},
                                 {"later", "later_cpu_of_full", "{:.0f} %", 100.0},
                                 {"rays", "rays_per_subpixel", "{:.2f}"},
                                 {"Tachyon", "over_tachyon", "{:.1f} x"},
                                 {"copies", "over_copy"}};
  json rows = json::array();
  for (const json& m : methods)
    if (!m["missing"].get<bool>()) rows.push_back(m);
  print_table(rows, kColumns, "  ");
}

void print_missing(const json& methods) {
  std::set<std::string> names;
  for (const json& m : methods)
    if (m["missing"].get<bool>()) names.insert(m["method"]);
  if (!names.empty())
    print_out("  not in this build: {}\n", fmt::format("{}", fmt::join(names, ", ")));
}

void print_errors(const json& methods) {
  constexpr Column kColumns[] = {{"error", "name"},
                                 {"PSNR", "psnr_mean_db", "{:.1f}", 1.0, "equal"},
                                 {"worst", "psnr_worst_db", "{:.1f}", 1.0, "equal"},
                                 {"view", "worst_view_psnr_db", "{:.1f}", 1.0, "equal"},
                                 {"max", "max"},
                                 {"over E", "share_over_e", "{:.4f} %", 100.0},
                                 {"bound", "bound/mean_bound", "{:.4f} %", 100.0},
                                 {"over 8", "share_over_8", "{:.3f} %", 100.0},
                                 {"over 32", "share_over_32", "{:.3f} %", 100.0},
                                 {"SSIM", "ssim_mean", "{:.4f}"},
                                 {"worst", "ssim_worst", "{:.4f}"},
                                 {"FLIP", "flip_mean", "{:.4f}"},
                                 {"99 %", "flip_p99_worst", "{:.3f}"},
                                 {"flicker", "flicker_mean", "{:.4f}"},
                                 {"max", "flicker_largest"},
                                 {"within bound", "bound/within_percent", "{:.0f} %"},
                                 {"of", "bound/frames"}};
  json rows = json::array();
  for (const json& m : methods)
    if (m.contains("psnr_mean_db")) rows.push_back(m);
  print_table(rows, kColumns, "  ");
}

/// Position in the plot of frames equal to full's, whose PSNR is infinite.
constexpr double kEqualDb = 80.0;

PlotSeries& series_of(Plot& plot, const std::string& name) {
  const auto found = std::ranges::find(plot.series, name, &PlotSeries::label);
  if (found != plot.series.end()) return *found;
  return plot.series.emplace_back(PlotSeries{.label = name, .points = {}, .joined = false});
}

std::string tachyon_text(const json& tachyon) {
  if (tachyon.contains("mray_s"))
    return fmt::format("; Tachyon {:.2f} Mray/s", tachyon["mray_s"].get<double>());
  if (tachyon.contains("failure"))
    return fmt::format("; Tachyon {}", tachyon["failure"].get<std::string>());
  return "";
}

void print_error_scenario(const json& scenario) {
  print_out("{}, {}, {}: {:.2f} M subpixels, copying them takes {:.2f} ms{}\n",
            scenario["scene"].get<std::string>(), scenario["rig"].get<std::string>(),
            scenario["course"].get<std::string>(), scenario["subpixels"].get<double>() / 1e6,
            1e3 * scenario["copy_s"].get<double>(), tachyon_text(scenario["tachyon"]));
  print_times(scenario["methods"]);
  print_errors(scenario["methods"]);
  print_missing(scenario["methods"]);
  for (const json& picture : scenario["pictures"])
    print_out("  {}: frame {}, pixel {}, {}, MSE {:.1f}\n", picture["file"].get<std::string>(),
              picture["frame"].get<int>(), picture["x"].get<int>(), picture["y"].get<int>(),
              picture["mse"].get<double>());
  print_out("\n");
}

void print_bound_of_all(const json& scenarios) {
  const json all = bound_of_all(scenarios);
  if (all.is_null()) return;
  print_out("the true share beyond E was within the reported bound in {:.1f} % of {} frames",
            all["within_percent"].get<double>(), all["frames"].get<int>());
  const double excess = all["largest_excess"].get<double>();
  print_out("{}\n", excess > 0.0 ? fmt::format(", at most {:.4f} % above it", 100.0 * excess) : "");
}

void plot_errors(const json& scenarios, const std::string& file) {
  Plot plot{.title = "Time against error, each scene, rig and course",
            .x = {.label = "time, as a share of full's", .scale = AxisScale::Log},
            .y = {.label = fmt::format("mean PSNR, dB ({:.0f}: equal, or more)", kEqualDb)},
            .series = {}};
  for (const json& scenario : scenarios)
    for (const json& m : scenario["methods"]) {
      if (!m.contains("psnr_mean_db") || m["of_full"].is_null()) continue;
      const json& psnr = m["psnr_mean_db"];
      const double decibels = psnr.is_null() ? kEqualDb : std::min(kEqualDb, psnr.get<double>());
      PlotSeries& series = series_of(plot, m["name"]);
      series.points.push_back({m["of_full"].get<double>(), decibels});
      series.names.push_back(fmt::format("{}, {}, {}", scenario["scene"].get<std::string>(),
                                         scenario["rig"].get<std::string>(),
                                         scenario["course"].get<std::string>()));
    }
  write_svg(plot, file);
}

// lenticule bench error measures the run time and the error of each render method.

struct ErrorFlags {
  std::vector<std::string> scenes = {"teapot", "room",  "small-balls", "primitives",
                                     "tree",   "gears", "gltf:teapot"};
  std::vector<std::string> rigs;
  std::vector<std::string> methods = {"full", "lens-view", "interpolate", "temporal", "adaptive"};
  std::vector<double> errors = {0.0, 0.5, 1.0, 2.0, 4.0, 8.0};
  std::vector<double> psnrs;
  std::vector<std::string> scenarios = {"still", "moving"};
  int frames = 6;
  int runs = 1;
  int threads = 0;
  int depth = 5;
  bool quick = false;
  bool no_peers = false;
  bool json = false;
  std::string svg;
  std::string pictures;
  render::SoftLight soft;
};

/// Maximum panel width of a quick run.
constexpr int kQuickWidth = 480;

std::vector<optics::Rig> rigs_of(const ErrorFlags& flags) {
  std::vector<optics::Rig> rigs;
  for (const std::string& file : flags.rigs) rigs.push_back(lab::bench_rig(file));
  if (rigs.empty()) rigs = {lab::kiosk_rig(), lab::coarser_rig(lab::kiosk_rig(), 2)};
  if (!flags.quick) return rigs;
  rigs.resize(1);
  const int width = rigs[0].panel.width_px;
  return {lab::coarser_rig(rigs[0], (width + kQuickWidth - 1) / kQuickWidth)};
}

/// Tachyon's rate hardly depends on the number of rays; these take a second or more.
constexpr double kMostPeerMrays = 2.0;

/// Returns the result of measure_peers(): full's whole frames against Tachyon's in interleaved
/// runs. Null if the comparison does not apply.
nlohmann::json beside_tachyon(const ErrorFlags& flags, const optics::Rig& rig,
                              const ErrorScene& scene) {
  const auto name = scene.name_for_peers();
  const bool comparable = name && !flags.soft.any();  // Tachyon has hard shadows only
  if (flags.no_peers || !comparable || player::interrupted()) return {};
  ExactFlags exact;
  exact.rig_instead = rig;
  exact.depth = flags.depth;
  exact.lights = 0;
  exact.runs = flags.runs;
  exact.threads = flags.threads;
  exact.peer_limit_s = 120;
  const double subpixels = 3.0 * rig.panel.width_px * rig.panel.height_px;
  exact.peer_mrays = std::min(kMostPeerMrays, subpixels / 1e6);
  return measure_peers(exact, *name)["rows"][0];
}

class ErrorRun {
 public:
  explicit ErrorRun(const ErrorFlags& flags)
      : flags_(flags),
        rigs_(rigs_of(flags)),
        entrants_(
            error_entrants(flags.methods, flags.errors, flags.psnrs, render::method_names())) {
    for (const std::string& scene : flags.scenes)
      scenes_.push_back(std::make_unique<ErrorScene>(scene));
  }

  ExitCode run() {
    player::Progress progress("error", "frames", frames_to_render());
    const auto done = [&] { progress.update(++frames_done_); };
    for (const optics::Rig& rig : rigs_)
      for (const auto& scene : scenes_) measure(rig, *scene, done);
    progress.finish();
    if (scenarios_.empty()) return player::interrupt_exit_code();
    if (!flags_.svg.empty()) plot_errors(scenarios_, flags_.svg);
    if (flags_.json)
      print_json({{"machine", machine_json()},
                  {"runs", flags_.runs},
                  {"soft_shadows", flags_.soft.shadow_samples},
                  {"occlusion", flags_.soft.occlusion_samples},
                  {"environment_light", flags_.soft.environment_samples},
                  {"bound", bound_of_all(scenarios_)},
                  {"courses", scenarios_}});
    else
      print_bound_of_all(scenarios_);
    return player::interrupt_exit_code();
  }

 private:
  [[nodiscard]] std::vector<ErrorScenario> scenarios_of(const ErrorScene& scene) const {
    std::vector<ErrorScenario> scenarios;
    for (const std::string& name : flags_.scenarios) {
      const auto at = std::ranges::find(kErrorScenarios, name) - std::begin(kErrorScenarios);
      const auto scenario = static_cast<ErrorScenario>(at);
      if (scenario != ErrorScenario::Moving || !scene.still()) scenarios.push_back(scenario);
    }
    return scenarios;
  }

  [[nodiscard]] uint64_t frames_to_render() const {
    const auto racing = std::ranges::count_if(entrants_, &ErrorEntrant::exists);
    int64_t frames = 0;
    for (const auto& scene : scenes_)
      for (const ErrorScenario scenario : scenarios_of(*scene))
        frames += scenario == ErrorScenario::Still ? 2 : flags_.frames;
    return static_cast<uint64_t>(frames * racing) * rigs_.size();
  }

  void measure(const optics::Rig& rig, const ErrorScene& scene, const std::function<void()>& done) {
    const nlohmann::json tachyon = beside_tachyon(flags_, rig, scene);
    for (const ErrorScenario scenario : scenarios_of(scene)) {
      if (player::interrupted()) return;
      nlohmann::json measured = measure_error({.rig = rig,
                                               .entrants = entrants_,
                                               .scenario = scenario,
                                               .frames = flags_.frames,
                                               .threads = flags_.threads,
                                               .depth = flags_.depth,
                                               .soft = flags_.soft,
                                               .runs = flags_.runs,
                                               .pictures = flags_.pictures},
                                              scene, done);
      if (measured.is_null()) return;
      summarize_errors(measured, tachyon);
      if (!flags_.json) {
        if (scenarios_.empty())
          print_out("machine   {}\ntimes     medians of {} interleaved run(s)\n\n", machine_text(),
                    flags_.runs);
        print_error_scenario(measured);
      }
      scenarios_.push_back(std::move(measured));
    }
  }

  const ErrorFlags& flags_;
  std::vector<optics::Rig> rigs_;
  std::vector<ErrorEntrant> entrants_;
  std::vector<std::unique_ptr<ErrorScene>> scenes_;
  uint64_t frames_done_ = 0;
  nlohmann::json scenarios_ = nlohmann::json::array();
};

}  // namespace

cli::Run declare_bench_error(CLI::App& app) {
  auto shared = std::make_shared<ErrorFlags>();
  ErrorFlags& flags = *shared;
  app.add_option("scenes", flags.scenes,
                 "built-in scenes, as for render, or gltf:NAME for one that is written as glTF")
      ->capture_default_str();
  app.add_option("--rig", flags.rigs,
                 "rig file; repeatable (default: the 4K and the Full HD kiosk)")
      ->allow_extra_args(false);
  app.add_option("--methods", flags.methods, "methods besides full; missing ones are reported")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--errors", flags.errors, "error that adaptive may make, in code values")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--psnrs", flags.psnrs, "PSNR that adaptive must prove, in dB")
      ->allow_extra_args(false)
      ->delimiter(',');
  app.add_option("--course", flags.scenarios,
                 "still: one frame twice; moving: consecutive frames of the animation; turning: "
                 "frames of one turn of the scene; objects: its objects and a light move")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->check(CLI::IsMember(
          std::vector<std::string>(std::begin(kErrorScenarios), std::end(kErrorScenarios))))
      ->capture_default_str();
  app.add_option("--frames", flags.frames, "number of frames of a course that is not still")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option("--runs", flags.runs, "number of runs; medians of times are reported")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  declare_depth(app, "--max-depth", flags.depth);
  declare_threads(app, flags.threads);
  app.add_flag("--quick", flags.quick,
               "measure only the first scene on the first rig, with larger pixels");
  app.add_flag("--no-peers", flags.no_peers,
               "leave out Tachyon (scripts/packages bench installs it)");
  app.add_option("--svg", flags.svg, "file for a plot of time against error");
  app.add_option("--pictures", flags.pictures,
                 "folder for pictures of the worst places: reference, test, difference; below, "
                 "what an eye sees");
  app.add_flag("--json", flags.json, "print as JSON");
  tools::declare_soft_light_flags(app, flags.soft);
  app.footer(
      "Example:\n  lenticule bench error tree gears --rig kiosk-27-1080.toml --errors 1,4 "
      "--svg error.svg --pictures worst");
  return [shared]() -> ExitCode {
    if (shared->quick) shared->scenes.resize(std::min<size_t>(1, shared->scenes.size()));
    return ErrorRun(*shared).run();
  };
}
}  // namespace lenticule::bench
