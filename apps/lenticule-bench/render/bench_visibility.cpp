// SPDX-License-Identifier: Apache-2.0
// lenticule bench visibility compares the row sweep with Embree's packets and with writing alone,
// in interleaved runs, and counts differences.

#include <CLI/CLI.hpp>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/probes/row_tracer.h"
#include "apps/lenticule-bench/probes/visibility_rate.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

struct VisibilityFlags {
  std::vector<std::string> scenes = {"teapot", "balls", "gears",     "mount",
                                     "rings",  "tree",  "teapot:40", "teapot:100"};
  std::string rig;
  int runs = 5;
  bool quick = false;
  bool json = false;
};

struct Times {
  std::vector<double> bare, packets, sweep, prepare, rays, write, ratio, bare_ratio;
};

/// Times each method once; every second run is in reverse order.
void time_once(const BenchScene& bench, const render::RowPlanes& planes, int threads, bool swapped,
               Times& times) {
  render::VisibilityTiming packets;
  render::SweepTiming sweep;
  if (swapped) sweep = render::time_row_sweep(planes, bench.scene(), threads);
  packets = render::time_visibility(bench.scene(), bench.model(), threads);
  if (!swapped) sweep = render::time_row_sweep(planes, bench.scene(), threads);
  times.bare.push_back(packets.bare_seconds);
  times.packets.push_back(packets.pass_seconds);
  times.sweep.push_back(sweep.seconds);
  times.prepare.push_back(sweep.prepare_seconds);
  times.rays.push_back(sweep.rays_seconds);
  times.write.push_back(sweep.write_seconds);
  times.ratio.push_back(packets.pass_seconds / sweep.seconds);
  times.bare_ratio.push_back(packets.bare_seconds / sweep.seconds);
}

nlohmann::json measure_threads(const BenchScene& bench, const render::RowPlanes& planes,
                               int threads, int runs) {
  Times times;
  for (int run = 0; run < runs && !interrupted(); ++run)
    time_once(bench, planes, threads, run % 2 != 0, times);
  const auto ns = [&](const std::vector<double>& seconds) {
    return nanoseconds_each(bench.subpixels(), median(seconds));
  };
  return {{"threads", threads},
          {"bare_embree_ns", ns(times.bare)},
          {"packets_ns", ns(times.packets)},
          {"sweep_ns", ns(times.sweep)},
          {"sweep_prepare_ns", ns(times.prepare)},
          {"sweep_rays_ns", ns(times.rays)},
          {"write_ns", ns(times.write)},
          {"bare_embree_per_sweep", median(times.bare_ratio)},
          {"packets_per_sweep", median(times.ratio)}};
}

nlohmann::json measure(const VisibilityFlags& flags, const optics::Rig& rig,
                       const std::string& scene) {
  const BenchScene bench({.scene = bench_scene_name(scene), .rig = rig});
  const render::RowPlanes planes(bench.model());
  // The step has no factor in common with the lenses, so that lens edges fall at all positions.
  const render::SweepDifference difference =
      render::compare_with_embree(planes, bench.scene(), 5, flags.quick ? 101 : 11);
  const auto per_million = [&](uint64_t count) {
    return 1e6 * static_cast<double>(count) / static_cast<double>(difference.subpixels);
  };
  nlohmann::json threads = nlohmann::json::array();
  for (const int count : {1, 2})
    threads.push_back(measure_threads(bench, planes, count, flags.runs));
  return {{"scene", scene},
          {"rig", rig.name},
          {"primitives", bench.primitives()},
          {"subpixels", bench.subpixels()},
          {"other_ids_per_million", per_million(difference.other_id)},
          {"elsewhere_per_million", per_million(difference.elsewhere)},
          {"one_sees_none_per_million", per_million(difference.one_sees_none)},
          {"depth_difference_mm", difference.depth_mm},
          {"times", std::move(threads)}};
}

void print(const nlohmann::json& r) {
  print_out(
      "{}, {}: {} primitives; other ids {:.2f}, elsewhere {:.2f}, one sees none {:.2f} per "
      "million, z within "
      "{:.2g} mm\n",
      r["scene"].get<std::string>(), r["rig"].get<std::string>(), r["primitives"].get<uint64_t>(),
      r["other_ids_per_million"].get<double>(), r["elsewhere_per_million"].get<double>(),
      r["one_sees_none_per_million"].get<double>(), r["depth_difference_mm"].get<double>());
  print_out("  {:>7} {:>12} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11} {:>14}\n", "threads",
            "bare Embree", "packets", "sweep", "- before", "- rays", "writing", "bare/sweep",
            "packets/sweep");
  for (const auto& t : r["times"]) {
    const auto ns = [&](const char* key) { return t[key].get<double>(); };
    print_out(
        "  {:>7} {:>12.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>11.2f} {:>14.2f}\n",
        t["threads"].get<int>(), ns("bare_embree_ns"), ns("packets_ns"), ns("sweep_ns"),
        ns("sweep_prepare_ns"), ns("sweep_rays_ns"), ns("write_ns"), ns("bare_embree_per_sweep"),
        ns("packets_per_sweep"));
  }
}

ExitCode run(VisibilityFlags flags) {
  if (flags.quick) flags.runs = 1;
  const optics::Rig rig = bench_rig(flags.rig);
  std::vector<optics::Rig> rigs = {rig};
  if (!flags.quick) rigs.push_back(coarser_rig(rig, 2));
  nlohmann::json results = nlohmann::json::array();
  if (!flags.json) print_out("{}; nanoseconds per subpixel\n", machine_text());
  for (const optics::Rig& one : rigs)
    for (const std::string& scene : flags.scenes) {
      if (interrupted()) return kInterrupted;
      results.push_back(measure(flags, one, scene));
      if (!flags.json) print(results.back());
    }
  if (flags.json)
    print_json({{"machine", machine_json()}, {"runs", flags.runs}, {"results", results}});
  return kOk;
}

}  // namespace

Run declare_bench_visibility(CLI::App& app) {
  auto flags = std::make_shared<VisibilityFlags>();
  app.add_option("scenes", flags->scenes, "scenes, as for render");
  app.add_option("--rig", flags->rig, "rig file instead of the 4K kiosk");
  app.add_option("--runs", flags->runs, "interleaved runs of each")->check(CLI::Range(1, 1000));
  app.add_flag("--quick", flags->quick, "measure one run and one rig, and compare fewer rows");
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags] { return run(*flags); };
}

}  // namespace lenticule::player
