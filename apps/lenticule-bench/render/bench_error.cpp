// SPDX-License-Identifier: Apache-2.0
// lenticule bench error measures the run time and the error of each render method.
#include "apps/lenticule-bench/render/bench_error.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "apps/lenticule-tools/cli/soft_light_flags.h"
#include "base/print.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/make_method.h"

namespace lenticule::bench {
namespace {

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
    for (const std::string& scenario : flags_.scenarios)
      if (scenario == "still")
        scenarios.push_back(ErrorScenario::Still);
      else if (scenario == "turning")
        scenarios.push_back(ErrorScenario::Turning);
      else if (!scene.still())
        scenarios.push_back(ErrorScenario::Moving);
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

void declare_what(CLI::App& app, ErrorFlags& flags) {
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
                 "frames of one turn of the scene")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->check(CLI::IsMember({"still", "moving", "turning"}))
      ->capture_default_str();
  app.add_option("--frames", flags.frames, "number of frames of a moving or turning course")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
}

}  // namespace

cli::Run declare_bench_error(CLI::App& app) {
  auto flags = std::make_shared<ErrorFlags>();
  declare_what(app, *flags);
  app.add_option("--runs", flags->runs, "number of runs; medians of times are reported")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--max-depth", flags->depth, "largest number of reflections and refractions")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--quick", flags->quick,
               "measure only the first scene on the first rig, with larger pixels");
  app.add_flag("--no-peers", flags->no_peers,
               "leave out Tachyon (scripts/packages bench installs it)");
  app.add_option("--svg", flags->svg, "file for a plot of time against error");
  app.add_option("--pictures", flags->pictures,
                 "folder for pictures of the worst places: reference, test, difference; below, "
                 "what an eye sees");
  app.add_flag("--json", flags->json, "print as JSON");
  tools::declare_soft_light_flags(app, flags->soft);
  app.footer(
      "Example:\n  lenticule bench error tree gears --rig kiosk-27-1080.toml --errors 1,4 "
      "--svg error.svg --pictures worst");
  return [flags]() -> ExitCode {
    if (flags->quick) flags->scenes.resize(std::min<size_t>(1, flags->scenes.size()));
    return ErrorRun(*flags).run();
  };
}

}  // namespace lenticule::bench
