// SPDX-License-Identifier: Apache-2.0
// lenticule bench cores says how many times as fast method adaptive is on many cores. It measures
// the processor time of each item of a frame's parallel loops, on one core, and simulates how more
// cores share them; what lies between the loops is serial. Real frames on two threads stand beside.
#include <oneapi/tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "base/print.h"
#include "lab/schedule.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {

namespace {

using nlohmann::json;

struct CoresFlags : RunFlags {
  std::vector<std::string> scenes = {"teapot", "room", "small-balls", "primitives", "tree"};
  double error = 2.0;
};

/// WatchedFrame holds the processor times of a frame on one core, in seconds.
struct WatchedFrame {
  std::vector<std::vector<double>> loops;  ///< items of each loop
  double serial = 0.0;                     ///< between the loops
  double since = clock_seconds(CLOCK_THREAD_CPUTIME_ID);

  void note(int loop, bool ends) {
    const double now = clock_seconds(CLOCK_THREAD_CPUTIME_ID);
    if (ends)
      loops.back().push_back(now - since);
    else if (static_cast<size_t>(loop) >= loops.size()) {
      serial += now - since;
      loops.resize(static_cast<size_t>(loop) + 1);
    }
    since = ends ? now : clock_seconds(CLOCK_THREAD_CPUTIME_ID);
  }
  void end() { serial += clock_seconds(CLOCK_THREAD_CPUTIME_ID) - since; }
  /// Takes the smaller times of another run, which other programs disturbed elsewhere.
  void take_less(const WatchedFrame& other) {
    serial = std::min(serial, other.serial);
    for (size_t loop = 0; loop < loops.size(); ++loop)
      for (size_t n = 0; n < loops[loop].size(); ++n)
        loops[loop][n] = std::min(loops[loop][n], other.loops[loop][n]);
  }
  [[nodiscard]] double on(int cores) const { return serial + lab::scheduled_time(loops, cores); }
};

/// Renders frames as for `cores` cores, but on one.
WatchedFrame watched(const CoresFlags& flags, BenchScene& scene, render::RenderOptions options,
                     int cores) {
  // The method divides its work for as many threads, of which none but this one runs.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  options.threads = cores;
  WatchedFrame frame, best;
  const auto method = render::make_method_adaptive(
      scene.model(), options, [&](int loop, bool ends) { frame.note(loop, ends); });
  for (int run = 0; run <= flags.runs; ++run) {
    frame = {};
    scene.render(*method);
    frame.end();
    if (player::interrupted()) break;
    if (run <= 1)  // the first frame takes memory from the system
      best = frame;
    else
      best.take_less(frame);
  }
  return best;
}

json measure(const CoresFlags& flags, const optics::Rig& rig, const std::string& name) {
  BenchScene scene({.scene = bench_scene_name(name), .rig = rig});
  render::RenderOptions options = scene.options(5);
  options.tolerated_error = flags.error;
  json row = {{"scene", name}};
  for (int cores = 1; cores <= 64; cores *= 2) {
    const WatchedFrame frame = watched(flags, scene, options, cores);
    if (player::interrupted()) return row;
    row["speed_up"][std::to_string(cores)] = frame.on(1) / frame.on(cores);
    if (cores < 64) continue;
    row["loops"] = json::array();
    double longest = 0.0;
    for (const std::vector<double>& loop : frame.loops) {
      longest = loop.empty() ? longest : std::max(longest, std::ranges::max(loop));
      row["loops"].push_back({{"items", loop.size()},
                              {"seconds", lab::scheduled_time(loop, 1)},
                              {"seconds_on_64", lab::scheduled_time(loop, 64)}});
    }
    row["longest_s"] = longest;
    row["seconds"] = frame.on(1);
    row["serial"] = frame.serial / frame.on(1);
  }
  options.threads = 1;
  const auto one = render::make_method_adaptive(scene.model(), options);
  options.threads = 2;
  const auto two = render::make_method_adaptive(scene.model(), options);
  std::vector<double> wall_of_one, wall_of_two;
  for (int run = 0; run < flags.runs; ++run) {
    wall_of_one.push_back(scene.render(*one).seconds);
    wall_of_two.push_back(scene.render(*two).seconds);
  }
  row["measured_on_2"] = median(wall_of_one) / median(wall_of_two);
  return row;
}

ExitCode run(const CoresFlags& flags) {
  const optics::Rig rig = lab::bench_rig(flags.rig);
  json rows = json::array();
  for (const std::string& name : flags.scenes) {
    rows.push_back(measure(flags, rig, name));
    if (player::interrupted()) return player::interrupt_exit_code();
  }
  if (flags.json) {
    print_json({{"benchmark", "cores"},
                {"machine", machine_json()},
                {"rig", rig.name},
                {"error", flags.error},
                {"scenes", rows}});
    return kOk;
  }
  print_out("machine   {}\nrig       {}, E = {}\n\n", machine_text(), rig.name, flags.error);
  constexpr Column kColumns[] = {{"", "scene"},
                                 {"1 core, s", "seconds", "{:.2f}"},
                                 {"longest, ms", "longest_s", "{:.2f}", 1e3},
                                 {"serial, %", "serial", "{:.2f}", 100.0},
                                 {"2 cores", "speed_up/2", "{:.2f}"},
                                 {"4", "speed_up/4", "{:.2f}"},
                                 {"8", "speed_up/8", "{:.2f}"},
                                 {"16", "speed_up/16", "{:.1f}"},
                                 {"32", "speed_up/32", "{:.1f}"},
                                 {"64", "speed_up/64", "{:.1f}"},
                                 {"2 threads, measured", "measured_on_2", "{:.2f}"}};
  print_table(rows, kColumns);
  return kOk;
}

}  // namespace

cli::Run declare_bench_cores(CLI::App& app) {
  auto flags = std::make_shared<CoresFlags>();
  app.add_option("scenes", flags->scenes, "built-in scenes NAME[:SIZE], or as for render")
      ->capture_default_str();
  declare_run_flags(app, *flags);
  app.add_option("--error", flags->error, "tolerated error of method adaptive, in code values")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  return [flags]() -> ExitCode { return run(*flags); };
}
}  // namespace lenticule::bench
