// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact measures the cost of an exact frame relative to Embree alone.
#include "apps/lenticule-bench/render/bench_exact.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

nlohmann::json heading(const ExactFlags& flags) {
  const optics::Rig rig = lab::bench_rig(flags.rig);
  return {{"benchmark", "exact"},        {"machine", machine_json()},     {"rig", rig.name},
          {"width", rig.panel.width_px}, {"height", rig.panel.height_px}, {"depth", flags.depth},
          {"lights", flags.lights},      {"threads", flags.threads},      {"runs", flags.runs}};
}

void print_heading(const nlohmann::json& r) {
  print_out("machine   {}\n", machine_text());
  print_out("rig       {}, {}x{}\n", r["rig"].get<std::string>(), r["width"].get<int>(),
            r["height"].get<int>());
  const int lights = r["lights"].get<int>();
  print_out("frames    {} bounce(s), {}, medians of {} interleaved run(s)\n", r["depth"].get<int>(),
            lights == 0 ? "all lights" : fmt::format("at most {} lights", lights),
            r["runs"].get<int>());
}

/// Parts measures each part of the benchmark, stores it under its name, and prints it unless the
/// output is JSON.
class Parts {
 public:
  explicit Parts(const ExactFlags& flags) : flags_(flags), result_(heading(flags)) {
    if (!flags.json) print_heading(result_);
  }

  void per_scene(const char* name, nlohmann::json (*measure)(const ExactFlags&, const std::string&),
                 void (*print)(const nlohmann::json&)) {
    result_[name] = nlohmann::json::array();
    for (const std::string& scene : flags_.scenes) {
      if (player::interrupted()) return;
      nlohmann::json part = measure(flags_, bench_scene_name(scene));
      if (!player::interrupted()) keep(name, std::move(part), print);
    }
  }

  void several(const char* name, nlohmann::json (*measure)(const ExactFlags&),
               void (*print)(const nlohmann::json&)) {
    result_[name] = nlohmann::json::array();
    if (player::interrupted()) return;
    for (nlohmann::json& part : measure(flags_))
      if (!player::interrupted()) keep(name, std::move(part), print);
  }

  [[nodiscard]] const nlohmann::json& result() const { return result_; }

 private:
  void keep(const char* name, nlohmann::json part, void (*print)(const nlohmann::json&)) {
    if (!flags_.json) {
      print_out("\n");
      print(part);
      flush_results();  // the next part may take minutes
    }
    result_[name].push_back(std::move(part));
  }

  const ExactFlags& flags_;
  nlohmann::json result_;
};

void make_folder(const std::string& folder) {
  std::error_code error;
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  if (error)
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot create: {}", folder, error.message()));
}

ExitCode run(ExactFlags flags) {
  flags.rates = flags.rates || !(flags.upright || flags.scaling || flags.growth || flags.peers);
  make_folder(flags.plots);
  make_folder(flags.peer_pictures);
  Parts parts(flags);
  if (flags.rates) parts.per_scene("scenes", measure_rates, print_rates);
  if (flags.upright) parts.per_scene("upright", measure_upright, print_upright);
  if (flags.scaling) parts.several("scaling", measure_scaling, print_growth);
  if (flags.growth) parts.several("growth", measure_growth, print_growth);
  if (flags.peers) parts.per_scene("peers", measure_peers, print_peers);
  if (player::interrupted()) return player::interrupt_exit_code();
  if (flags.json) print_json(parts.result());
  return kOk;
}

void declare_parts(CLI::App& app, ExactFlags& flags) {
  app.add_flag(
      "--rates", flags.rates,
      "measure bare Embree, visibility and whole frames (default if no other part is requested)");
  app.add_flag("--upright", flags.upright, "compare the slanted rig with an upright one");
  app.add_flag("--scaling", flags.scaling, "measure 1, 2, ... all threads");
  app.add_flag("--growth", flags.growth,
               "measure growing numbers of subpixels, triangles, lights and subpixels per lens");
  app.add_flag("--peers", flags.peers, "compare with Tachyon (scripts/packages bench installs it)");
}

void declare_peers(CLI::App& app, ExactFlags& flags) {
  app.add_option(
         "--peer-mrays", flags.peer_mrays,
         "million primary rays of the other ray tracers' pictures; 0 means as many as subpixels")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option("--peer-limit", flags.peer_limit_s,
                 "seconds after which a run of another ray tracer is ended")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str();
  app.add_option("--peer-pictures", flags.peer_pictures,
                 "folder for a small picture of each scene by each other ray tracer");
}

}  // namespace

BenchSetup exact_setup(const ExactFlags& flags, const std::string& scene) {
  return {.scene = scene,
          .rig = flags.rig_instead ? *flags.rig_instead : lab::bench_rig(flags.rig),
          .lights = flags.lights,
          .threads = flags.threads};
}

cli::Run declare_bench_exact(CLI::App& app) {
  auto flags = std::make_shared<ExactFlags>();
  app.add_option("--scene", flags->scenes, "a built-in NAME[:SIZE], or as for render; repeatable")
      ->capture_default_str();
  app.add_option("--rig", flags->rig, "rig file (default: the 4K kiosk)");
  app.add_option("--depth", flags->depth, "number of bounces of mirrored and refracted rays")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  app.add_option("--lights", flags->lights, "use at most this many lights; 0 uses all")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--runs", flags->runs, "number of runs; medians are reported")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  declare_parts(app, *flags);
  declare_peers(app, *flags);
  app.add_option("--plots", flags->plots, "folder for plots of scaling and growth as SVG");
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags]() -> ExitCode { return run(*flags); };
}

}  // namespace lenticule::bench
