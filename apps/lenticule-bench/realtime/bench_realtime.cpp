// SPDX-License-Identifier: Apache-2.0
// lenticule bench realtime renders moving scenes into the ring of a player, and measures frames per
// second, latency, missed vblanks, error and memory.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/realtime/realtime.h"
#include "apps/lenticule-tools/offline/error_controller.h"
#include "base/error.h"
#include "base/print.h"
#include "player/process/interrupt.h"
#include "render/make_method.h"

namespace lenticule::bench {
namespace {

struct RealtimeFlags {
  std::vector<std::string> scenes = {"teapot", "room", "small-balls", "primitives", "tree"};
  std::vector<std::string> rigs;
  std::vector<std::string> methods = {"adaptive"};
  std::vector<double> errors = {2.0};
  std::vector<double> psnrs = {40.0};
  std::vector<double> adapt_rates;
  double seconds = 60.0;
  std::string fps = "30";
  std::string refresh = "60";
  int samples = 5;
  int slots = 3;
  int threads = 0;
  int depth = 5;
  bool json = false;
  std::string plots;
};

std::vector<optics::Rig> rigs_of(const RealtimeFlags& flags) {
  std::vector<optics::Rig> rigs;
  for (const std::string& file : flags.rigs) rigs.push_back(lab::bench_rig(file));
  if (rigs.empty()) rigs = {lab::coarser_rig(lab::kiosk_rig(), 2), lab::kiosk_rig()};
  return rigs;
}

std::vector<ErrorEntrant> entrants_of(const RealtimeFlags& flags) {
  const auto& known = render::method_names();
  std::vector<ErrorEntrant> entrants =
      error_entrants(flags.methods, flags.errors, flags.psnrs, known);
  if (std::ranges::find(flags.methods, "full") == flags.methods.end())
    entrants.erase(entrants.begin());
  for (const ErrorEntrant& entrant : entrants)
    if (!entrant.exists)
      throw Error(ErrorKind::Usage, fmt::format("--methods: no method '{}'", entrant.method),
                  fmt::format("methods are {}", fmt::join(known, ", ")));
  if (entrants.empty())
    throw Error(ErrorKind::Usage, "--methods: adaptive without an error",
                "give --errors or --psnrs");
  return entrants;
}

/// A method, and the rate for which its error is adapted.
struct Case {
  ErrorEntrant entrant;
  std::optional<double> adapt_rate{};
};

std::vector<Case> cases_of(const RealtimeFlags& flags, bool errors_given) {
  std::vector<Case> cases;
  if (flags.adapt_rates.empty() || errors_given)
    for (const ErrorEntrant& entrant : entrants_of(flags)) cases.push_back({.entrant = entrant});
  for (const double rate : flags.adapt_rates) {
    static_cast<void>(tools::ErrorController(rate));  // checks the rate before the first run
    cases.push_back({.entrant = {.name = fmt::format("adaptive {:g}/s", rate),
                                 .method = "adaptive",
                                 .tolerated = tools::ErrorController::kFirstError},
                     .adapt_rate = rate});
  }
  return cases;
}

class RealtimeRun {
 public:
  RealtimeRun(const RealtimeFlags& flags, bool errors_given)
      : flags_(flags),
        fps_(frames::parse_rate(flags.fps)),
        refresh_(frames::parse_rate(flags.refresh)),
        rigs_(rigs_of(flags)),
        cases_(cases_of(flags, errors_given)) {
    if (fps_.hertz() > refresh_.hertz())
      throw Error(ErrorKind::Usage, "--fps: more than --refresh, so frames would never be shown");
    if (!flags.plots.empty()) std::filesystem::create_directories(flags.plots);
  }

  ExitCode run() {
    if (!flags_.json)
      print_out("machine    {}\nrun        {:g} s each, {} scene frames/s, panel {} Hz\n\n",
                machine_text(), flags_.seconds, flags_.fps, flags_.refresh);
    for (const optics::Rig& rig : rigs_)
      for (const std::string& scene : flags_.scenes)
        for (const Case& one : cases_)
          if (!player::interrupted()) measure(rig, scene, one);
    if (flags_.json)
      print_json({{"benchmark", "realtime"},
                  {"machine", machine_json()},
                  {"seconds", flags_.seconds},
                  {"fps", fps_.hertz()},
                  {"runs", runs_}});
    else
      print_realtime_table(runs_);
    return player::interrupt_exit_code();
  }

 private:
  void measure(const optics::Rig& rig, const std::string& scene, const Case& one) {
    const nlohmann::json run = measure_realtime({.scene = scene,
                                                 .rig = rig,
                                                 .entrant = one.entrant,
                                                 .seconds = flags_.seconds,
                                                 .fps = fps_,
                                                 .threads = flags_.threads,
                                                 .depth = flags_.depth,
                                                 .adapt_rate = one.adapt_rate,
                                                 .samples = flags_.samples},
                                                {.refresh = refresh_, .slots = flags_.slots});
    runs_.push_back(run);
    if (!flags_.json) {
      print_realtime(run);
      flush_results();
    }
    if (!flags_.plots.empty()) plot_realtime(run, plot_file(rig, scene, one.entrant));
  }

  [[nodiscard]] std::string plot_file(const optics::Rig& rig, const std::string& scene,
                                      const ErrorEntrant& entrant) const {
    std::string name = fmt::format("{}-{}-{}.svg", scene, rig.panel.height_px, entrant.name);
    std::ranges::replace_if(
        name, [](char c) { return c == ' ' || c == '/' || c == ':'; }, '-');
    return (std::filesystem::path(flags_.plots) / name).string();
  }

  const RealtimeFlags& flags_;
  frames::Rate fps_;
  frames::Rate refresh_;
  std::vector<optics::Rig> rigs_;
  std::vector<Case> cases_;
  nlohmann::json runs_ = nlohmann::json::array();
};

void declare_what(CLI::App& app, RealtimeFlags& flags) {
  app.add_option("scenes", flags.scenes,
                 "built-in scenes, as for render, or gltf:NAME for one that is written as glTF")
      ->capture_default_str();
  app.add_option("--rig", flags.rigs,
                 "rig file; repeatable (default: the Full HD and the 4K kiosk)")
      ->allow_extra_args(false);
  app.add_option("--methods", flags.methods, "render methods")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--errors", flags.errors,
                 "error that adaptive may make, in code values; without the default --psnrs")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--psnrs", flags.psnrs,
                 "PSNR that adaptive must prove, in dB; without the default --errors")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
}

void declare_adapting(CLI::App& app, RealtimeFlags& flags) {
  app.add_option("--adapt-error", flags.adapt_rates,
                 "frames per second that adaptive holds by choosing the error of each frame, 0.5 "
                 "to 16 code values; instead of --errors and --psnrs unless these are given")
      ->allow_extra_args(false)
      ->delimiter(',');
}

void declare_how(CLI::App& app, RealtimeFlags& flags) {
  app.add_option("--seconds", flags.seconds, "length of each run")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  app.add_option("--fps", flags.fps,
                 "frames of the scene per second; the renderer takes the one due")
      ->capture_default_str();
  app.add_option("--refresh", flags.refresh, "vblanks of the panel per second")
      ->capture_default_str();
  app.add_option("--samples", flags.samples,
                 "frames of each run that are compared with method full afterwards")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  app.add_option("--slots", flags.slots, "slots of the ring")
      ->check(CLI::Range(3, 64))
      ->capture_default_str();
  app.add_option("--max-depth", flags.depth, "largest number of reflections and refractions")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  app.add_option("--threads", flags.threads, "threads of the renderer; 0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--plots", flags.plots,
                 "folder for a plot of each run: rate, tolerated error and error over time");
  app.add_flag("--json", flags.json, "print as JSON");
}

}  // namespace

cli::Run declare_bench_realtime(CLI::App& app) {
  auto flags = std::make_shared<RealtimeFlags>();
  declare_what(app, *flags);
  declare_adapting(app, *flags);
  declare_how(app, *flags);
  app.footer(
      "Example:\n  lenticule bench realtime teapot --rig scenes/rigs/kiosk-27-4k.toml --errors 2 "
      "--psnrs 40\n");
  return [flags, &app] {
    const bool errors = app.count("--errors") > 0;
    const bool psnrs = app.count("--psnrs") > 0;
    if (psnrs && !errors) flags->errors.clear();
    if (errors && !psnrs) flags->psnrs.clear();
    return RealtimeRun(*flags, errors || psnrs).run();
  };
}

}  // namespace lenticule::bench
