// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact: what an exact frame costs, and how near it comes to what Embree can do.
#include <fmt/format.h>

#include <memory>

#include "optics/error.h"
#include "player/bench.h"
#include "player/interrupt.h"
#include "player/scene_sequence.h"
#include "render/method.h"
#include "render/visibility_rate.h"

namespace lenticule::player {
namespace {

struct ExactFlags {
  std::string rig;
  std::string scene = "builtin:teapot";
  int runs = 5;
  int threads = 0;
  bool json = false;
};

struct Samples {
  std::vector<double> bare;
  std::vector<double> visibility;
  std::vector<double> frame;
};

/// One round of each, so that what else the machine does falls on all three alike.
void run_round(const render::Scene& scene, const render::Stage& stage,
               const optics::OpticalModel& model, render::Method& method, int threads,
               frames::WovenFrame& frame, Samples& samples, render::RenderStatistics& statistics) {
  const render::VisibilityTiming timing = render::time_visibility(scene, model, threads);
  samples.bare.push_back(timing.bare_seconds);
  samples.visibility.push_back(timing.pass_seconds);
  statistics = method.render(scene, stage, frame);
  samples.frame.push_back(statistics.seconds);
}

nlohmann::json results(const ExactFlags& flags, const optics::Rig& rig, const Samples& samples,
                       const render::RenderStatistics& statistics) {
  const double bare = median(samples.bare);
  const double visibility = median(samples.visibility);
  const double frame = median(samples.frame);
  const auto mega_rate = [](uint64_t rays, double seconds) {
    return static_cast<double>(rays) / seconds / 1e6;
  };
  const uint64_t all_rays =
      statistics.primary_rays + statistics.shadow_rays + statistics.secondary_rays;
  return {{"benchmark", "exact"},
          {"machine", machine_json()},
          {"scene", flags.scene},
          {"rig", rig.name},
          {"width", rig.panel.width_px},
          {"height", rig.panel.height_px},
          {"threads", flags.threads},
          {"runs", samples.frame.size()},
          {"primary_rays", statistics.primary_rays},
          {"shadow_rays", statistics.shadow_rays},
          {"secondary_rays", statistics.secondary_rays},
          {"bare_embree_mray_s", mega_rate(statistics.primary_rays, bare)},
          {"visibility_mray_s", mega_rate(statistics.primary_rays, visibility)},
          {"frame_msubpixel_s", mega_rate(statistics.subpixels, frame)},
          {"frame_mray_s", mega_rate(all_rays, frame)},
          {"visibility_seconds", visibility},
          {"frame_seconds", frame},
          {"visibility_of_bare", bare / visibility},
          {"frame_of_visibility", visibility / frame}};
}

void print_text(const nlohmann::json& r) {
  const auto number = [&](const char* key) { return r[key].get<double>(); };
  fmt::print("machine          {}\n", machine_text());
  fmt::print("scene, rig       {}, {} ({}x{})\n", r["scene"].get<std::string>(),
             r["rig"].get<std::string>(), r["width"].get<int>(), r["height"].get<int>());
  fmt::print("medians of       {} runs\n", r["runs"].get<int>());
  fmt::print("bare Embree      {:8.1f} Mray/s   packets made before\n",
             number("bare_embree_mray_s"));
  fmt::print("visibility       {:8.1f} Mray/s   {:.3f} s, {:.0f} % of bare Embree\n",
             number("visibility_mray_s"), number("visibility_seconds"),
             100.0 * number("visibility_of_bare"));
  fmt::print("whole frame      {:8.1f} Msubpixel/s, {:.1f} Mray/s with shadows and reflections\n",
             number("frame_msubpixel_s"), number("frame_mray_s"));
  fmt::print("                 {:.3f} s per frame\n", number("frame_seconds"));
}

ExitCode run(const ExactFlags& flags) {
  const optics::Rig rig = bench_rig(flags.rig);
  const optics::OpticalModel model(rig);
  const SceneSequence scenes(flags.scene, frames::Rate{});
  const render::SceneDescription description = scenes.at(scenes.reference_frame());
  const render::Stage stage = render::make_stage(description, model);
  const render::Scene scene(description, stage, {}, flags.threads);
  const auto method =
      render::make_method("full", model, {.threads = flags.threads, .cancelled = interrupted});
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px, frames::PixelFormat::Rgb8});

  Samples samples;
  render::RenderStatistics statistics;
  for (int i = 0; i < flags.runs; ++i) {
    run_round(scene, stage, model, *method, flags.threads, frame, samples, statistics);
    if (interrupted()) return interrupt_exit_code();
  }
  const nlohmann::json result = results(flags, rig, samples, statistics);
  if (flags.json)
    print_json(result);
  else
    print_text(result);
  return kOk;
}

}  // namespace

Run declare_bench_exact(CLI::App& app) {
  auto flags = std::make_shared<ExactFlags>();
  app.add_option("--rig", flags->rig, "rig file; the 4K kiosk if left out");
  app.add_option("--scene", flags->scene, "as for render")->capture_default_str();
  app.add_option("--runs", flags->runs, "medians are taken over these")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags]() -> ExitCode { return run(*flags); };
}

}  // namespace lenticule::player
