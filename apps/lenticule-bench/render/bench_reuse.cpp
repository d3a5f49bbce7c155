// SPDX-License-Identifier: Apache-2.0
// lenticule bench reuse measures the time that methods with reuse of points save, and their error.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "base/print.h"
#include "frames/compare.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

using render::ReuseOptions;

struct ReuseFlags {
  std::vector<std::string> scenes = {"teapot", "balls", "tree"};
  std::string rig;
  int depth = 5;
  int runs = 3;
  int threads = 0;
  bool variants = false;
  bool json = false;
};

/// A method with its options.
struct Way {
  const char* name;
  const char* method;
  void (*change)(ReuseOptions& reuse);
};

void as_published(ReuseOptions& reuse) {
  reuse = render::literal_reuse();
}

const std::vector<Way>& plain_ways() {
  static const std::vector<Way> table = {
      {"full", "full", [](ReuseOptions&) {}},
      {"lens-view", "lens-view", [](ReuseOptions&) {}},
      {"interpolate", "interpolate", [](ReuseOptions&) {}},
  };
  return table;
}

/// Returns the variants. Each differs in one step from another one, so that the table shows the
/// effect of the step.
const std::vector<Way>& variant_ways() {
  static const std::vector<Way> table = {
      {"lens-view, as published", "lens-view", as_published},
      {"  and the nearer wins", "lens-view",
       [](ReuseOptions& reuse) {
         as_published(reuse);
         reuse.occlusion = true;
       }},
      {"  and a quarter slot", "lens-view",
       [](ReuseOptions& reuse) {
         as_published(reuse);
         reuse.occlusion = true;
         reuse.within = 0.25F;
       }},
      {"  and no gloss", "lens-view",
       [](ReuseOptions& reuse) {
         as_published(reuse);
         reuse.occlusion = true;
         reuse.within = 0.25F;
         reuse.reuse_glossy = false;
       }},
      {"chords, chain, any colours", "lens-view",
       [](ReuseOptions& reuse) {
         reuse.key_every = 0;
         reuse.agreement = 255.0F;
       }},
      {"chords, chain, 16 codes", "lens-view", [](ReuseOptions& reuse) { reuse.key_every = 0; }},
      {"chords, chain, 4 codes", "lens-view",
       [](ReuseOptions& reuse) {
         reuse.key_every = 0;
         reuse.agreement = 4.0F;
       }},
      {"every 2nd traced, any colours", "lens-view",
       [](ReuseOptions& reuse) { reuse.agreement = 255.0F; }},
      {"every 2nd, 16 codes", "lens-view", [](ReuseOptions& reuse) { reuse.agreement = 16.0F; }},
      {"every 2nd, 8 codes", "lens-view", [](ReuseOptions& reuse) { reuse.agreement = 8.0F; }},
      {"every 2nd, 8 codes, two sides", "lens-view",
       [](ReuseOptions& reuse) {
         reuse.agreement = 8.0F;
         reuse.one_side = false;
       }},
      {"every 3rd, 8 codes", "lens-view",
       [](ReuseOptions& reuse) {
         reuse.key_every = 3;
         reuse.agreement = 8.0F;
       }},
      {"every 4th, 16 codes", "lens-view", [](ReuseOptions& reuse) { reuse.key_every = 4; }},
      {"every 4th, 8 codes", "lens-view",
       [](ReuseOptions& reuse) {
         reuse.key_every = 4;
         reuse.agreement = 8.0F;
       }},
      {"every 4th, 8 codes, two sides", "lens-view",
       [](ReuseOptions& reuse) {
         reuse.key_every = 4;
         reuse.agreement = 8.0F;
         reuse.one_side = false;
       }},
      {"interpolate, as published", "interpolate", as_published},
      {"  and the nearer wins", "interpolate",
       [](ReuseOptions& reuse) {
         as_published(reuse);
         reuse.occlusion = true;
       }},
      {"interpolate, odd ones chained", "interpolate",
       [](ReuseOptions& reuse) { reuse.key_every = 0; }},
      {"interpolate, odd ones traced", "interpolate",
       [](ReuseOptions& reuse) { reuse.key_every = 1; }},
      {"interpolate, any two meant", "interpolate",
       [](ReuseOptions& reuse) { reuse.mean_agreement = 255.0F; }},
      {"interpolate, any colours", "interpolate",
       [](ReuseOptions& reuse) { reuse.agreement = reuse.mean_agreement = 255.0F; }},
  };
  return table;
}

double part(uint64_t count, uint64_t of) {
  return of > 0 ? static_cast<double>(count) / static_cast<double>(of) : 0.0;
}

nlohmann::json error_json(const frames::WovenFrame& reference, const frames::WovenFrame& test,
                          const optics::OpticalModel& model) {
  const frames::Difference total = frames::compare_pictures(reference.view(), test.view()).total;
  const auto views = frames::compare_views(reference.view(), test.view(), model,
                                           frames::native_view_count(model.rig()));
  const frames::Difference& worst = views[static_cast<size_t>(frames::worst_view(views))];
  nlohmann::json json = {{"psnr_db", nullptr},
                         {"worst_view_psnr_db", nullptr},
                         {"max", total.max()},
                         {"over_8", part(total.count_over(8), total.samples())},
                         {"over_32", part(total.count_over(32), total.samples())}};
  if (const auto psnr = total.psnr_db()) json["psnr_db"] = *psnr;
  if (const auto psnr = worst.psnr_db()) json["worst_view_psnr_db"] = *psnr;
  return json;
}

/// A variant and its measurements on one scene.
struct Measured {
  const Way* way = nullptr;
  std::unique_ptr<render::Method> method;
  std::vector<double> seconds;
  render::RenderStatistics statistics;
  nlohmann::json error;
};

nlohmann::json measure_scene(const ReuseFlags& flags, const std::string& name,
                             std::vector<Way> ways) {
  BenchScene scene({.scene = bench_scene_name(name),
                    .rig = bench_rig(flags.rig),
                    .lights = 0,
                    .threads = flags.threads});
  std::vector<Measured> all;
  for (const Way& way : ways) {
    render::RenderOptions options = scene.options(flags.depth);
    way.change(options.reuse);
    all.push_back({.way = &way,
                   .method = render::make_method(way.method, scene.model(), options),
                   .seconds = {},
                   .statistics = {},
                   .error = {}});
  }
  frames::WovenFrame reference;
  // Interleaved runs, so that other load on the machine affects all equally.
  for (int run = 0; run < flags.runs && !interrupted(); ++run)
    for (Measured& one : all) {
      one.statistics = scene.render(*one.method);
      if (!one.statistics.completed) return {{"scene", name}, {"rows", nlohmann::json::array()}};
      one.seconds.push_back(one.statistics.seconds);
      if (run > 0) continue;
      if (&one == all.data()) reference = scene.frame();
      one.error = error_json(reference, scene.frame(), scene.model());
    }
  nlohmann::json rows = nlohmann::json::array();
  const double full = median(all.front().seconds);
  for (const Measured& one : all) {
    const render::RenderStatistics& s = one.statistics;
    const double seconds = median(one.seconds);
    rows.push_back({{"name", one.way->name},
                    {"method", one.way->method},
                    {"seconds", seconds},
                    {"time_saved", full > 0.0 ? 1.0 - seconds / full : 0.0},
                    {"not_traced", 1.0 - part(s.traced_subpixels, s.subpixels)},
                    {"missing", part(s.missing_subpixels, s.subpixels)},
                    {"interpolated", part(s.interpolated_subpixels, s.subpixels)},
                    {"error", one.error}});
  }
  return {{"scene", name}, {"rows", rows}};
}

void print_scene(const nlohmann::json& measured) {
  print_out("\n{:<32} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>4} {:>8}\n",
            measured["scene"].get<std::string>(), "seconds", "saved", "reused", "missing", "mean",
            "PSNR", "worst", "max", "over 32");
  for (const auto& row : measured["rows"]) {
    const auto percent = [&row](const char* key) { return 100.0 * row[key].get<double>(); };
    print_out(
        "{:<32} {:>8.4f} {:>5.0f} % {:>5.1f} % {:>5.1f} % {:>5.1f} % {:>7} {:>7} {:>4} {:>6.2f} "
        "%\n",
        row["name"].get<std::string>(), row["seconds"].get<double>(), percent("time_saved"),
        percent("not_traced"), percent("missing"), percent("interpolated"),
        decibels(row["error"]["psnr_db"]), decibels(row["error"]["worst_view_psnr_db"]),
        row["error"]["max"].get<int>(), 100.0 * row["error"]["over_32"].get<double>());
  }
}

ExitCode run_reuse(const ReuseFlags& flags) {
  std::vector<Way> ways = plain_ways();
  if (flags.variants) ways.insert(ways.end(), variant_ways().begin(), variant_ways().end());
  nlohmann::json report = {{"machine", machine_json()},
                           {"rig", bench_rig(flags.rig).name},
                           {"scenes", nlohmann::json::array()}};
  if (!flags.json)
    print_out("machine   {}\nrig       {}\n", machine_text(), report["rig"].get<std::string>());
  for (const std::string& scene : flags.scenes) {
    if (interrupted()) break;
    report["scenes"].push_back(measure_scene(flags, scene, ways));
    if (!flags.json) print_scene(report["scenes"].back());
  }
  if (flags.json) print_json(report);
  return interrupt_exit_code();
}

}  // namespace

Run declare_bench_reuse(CLI::App& app) {
  const auto flags = std::make_shared<ReuseFlags>();
  app.add_option("--scene", flags->scenes, "built-in scenes, or as for render")
      ->capture_default_str();
  app.add_option("--rig", flags->rig, "rig file (default: the 4K kiosk)");
  app.add_option("--max-depth", flags->depth, "largest number of reflections and refractions")
      ->capture_default_str();
  app.add_option("--runs", flags->runs, "frames of each method; times are medians")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")->capture_default_str();
  app.add_flag("--variants", flags->variants, "also measure variants of the reuse methods");
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags] { return run_reuse(*flags); };
}

}  // namespace lenticule::player
