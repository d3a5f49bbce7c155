// SPDX-License-Identifier: Apache-2.0
// lenticule bench depth compares ways to render deep scenes: one ray per subpixel, several, and
// prefiltered, each against many rays over the whole beam of every subpixel.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_error_eyes.h"
#include "apps/lenticule-bench/render/bench_error_pictures.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "base/print.h"
#include "frames/compare.h"
#include "frames/decoded_view.h"
#include "frames/image_io.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/depth_budget/depth_histogram.h"
#include "render/make_method.h"

namespace lenticule::player {
namespace {

struct DepthBenchFlags {
  std::vector<std::string> scenes = {"tree", "room", "gears"};
  std::string rig;
  double budget = 4.0;
  int frames = 2;
  int step = 1;
  int ground_truth = 65;
  int threads = 0;
  std::string pictures;
  bool quick = false;
  bool json = false;
};

/// A set of render options and its results so far.
struct Contender {
  std::string name;
  render::RenderOptions options;
  EyeFlicker flicker{};
  WorstPlaces worst{};
  nlohmann::json frames = nlohmann::json::array();
};

Contender contender(std::string name, int samples, render::Prefilter prefilter, int rays) {
  Contender one{.name = std::move(name), .options = {}};
  one.options.samples = samples;
  one.options.prefilter = prefilter;
  one.options.prefilter_samples = rays;
  return one;
}

std::vector<Contender> contenders() {
  using render::Prefilter;
  std::vector<Contender> all;
  all.push_back(contender("one ray", 1, Prefilter::Off, 17));
  all.push_back(contender("samples 4", 4, Prefilter::Off, 17));
  all.push_back(contender("samples 16", 16, Prefilter::Off, 17));
  all.push_back(contender("depth 17", 1, Prefilter::Depth, 17));
  all.push_back(contender("beam 5", 1, Prefilter::Beam, 5));
  all.push_back(contender("beam 17", 1, Prefilter::Beam, 17));
  all.push_back(contender("exhaust. 5", 1, Prefilter::Exhaustive, 5));
  all.push_back(contender("exhaust. 17", 1, Prefilter::Exhaustive, 17));
  return all;
}

/// Returns the MSE over the subpixels where `beyond` is 255, or over the others.
double mse_where(const frames::WovenFrame& a, const frames::WovenFrame& b,
                 const frames::WovenFrame& beyond, bool is_beyond) {
  frames::Difference difference;
  for (size_t n = 0; n < a.bytes().size(); ++n)
    if ((beyond.bytes()[n] != 0) == is_beyond) difference.add(a.bytes()[n], b.bytes()[n]);
  return difference.mse();
}

class DepthScenario {
 public:
  DepthScenario(const DepthBenchFlags& flags, const optics::Rig& rig, const std::string& scene)
      : flags_(flags),
        name_(scene),
        model_(rig),
        workers_(flags.threads),
        eyes_(model_, workers_),
        scenes_(bench_scene_name(scene), frames::Rate{}),
        stages_(scenes_.at(scenes_.reference_frame()), model_, {.depth_budget = flags.budget}),
        ground_truth_(geometry()),
        beyond_(geometry()),
        frame_(geometry()),
        contenders_(contenders()) {}

  [[nodiscard]] nlohmann::json run(const std::function<void()>& done) {
    const int frames = scenes_.still() ? 1 : flags_.frames;
    for (int n = 0; n < frames && !interrupted(); ++n) {
      frame(n);
      done();
    }
    nlohmann::json ways = nlohmann::json::array();
    for (const Contender& one : contenders_) {
      ways.push_back({{"name", one.name}, {"frames", one.frames}});
      if (!flags_.pictures.empty())
        ways.back()["pictures"] =
            one.worst.write(flags_.pictures, fmt::format("{}-{}", name_, one.name));
    }
    return {{"scene", name_},
            {"rig", model_.rig().name},
            {"depth_budget", flags_.budget},
            {"truth_rays", flags_.ground_truth},
            {"share_beyond", share_beyond_},
            {"ways", std::move(ways)}};
  }

 private:
  [[nodiscard]] frames::FrameGeometry geometry() const {
    const optics::Panel& panel = model_.rig().panel;
    return {panel.width_px, panel.height_px, frames::PixelFormat::Rgb8};
  }

  /// Renders a frame. Each variant has its own scene, because results of culling are stored in the
  /// scene.
  render::RenderStatistics render(const render::SceneDescription& description,
                                  render::RenderOptions options, frames::WovenFrame& out,
                                  double& cpu_s) {
    const render::Stage stage = stages_.at(description);
    const render::Scene scene(description, stage, {}, flags_.threads);
    options.threads = flags_.threads;
    options.cancelled = [] { return interrupted(); };
    const auto method = render::make_method("full", model_, options);
    const double start = process_cpu_seconds();
    const render::RenderStatistics statistics = method->render(scene, stage, out);
    cpu_s = process_cpu_seconds() - start;
    return statistics;
  }

  void frame(int number) {
    const render::SceneDescription description =
        scenes_.at(scenes_.reference_frame() +
                   static_cast<uint64_t>(number) * static_cast<uint64_t>(flags_.step));
    double cpu_s = 0.0;
    render(description,
           contender("", 1, render::Prefilter::Exhaustive, flags_.ground_truth).options,
           ground_truth_, cpu_s);
    eyes_.set_reference(ground_truth_.view());
    {
      const render::Scene scene(description, stages_.at(description), {}, flags_.threads);
      const render::DepthHistogram depth =
          render::measure_depth(model_, scene, flags_.threads, {.beyond = &beyond_});
      share_beyond_ =
          1.0 - static_cast<double>(depth.within()) / static_cast<double>(depth.subpixels());
    }
    for (Contender& one : contenders_) {
      if (interrupted()) return;
      const render::RenderStatistics statistics = render(description, one.options, frame_, cpu_s);
      measure(one, number, statistics, cpu_s);
    }
  }

  void measure(Contender& one, int number, const render::RenderStatistics& statistics,
               double cpu_s) {
    const nlohmann::json eyes = eyes_.compare(frame_.view(), one.flicker);
    double seen_mse = 0.0, flip = 0.0, flicker = 0.0;
    for (size_t e = 0; e < kErrorEyes; ++e) {
      seen_mse += frames::compare_pictures(eyes_.reference()[e].view(), eyes_.test()[e].view())
                      .total.mse() /
                  kErrorEyes;
      flip += eyes[e]["flip_mean"].get<double>() / kErrorEyes;
      flicker += eyes[e]["flicker_mean"].get<double>() / kErrorEyes;
    }
    const auto subpixels = static_cast<double>(statistics.subpixels);
    one.frames.push_back(
        {{"cpu_s", cpu_s},
         {"rays_per_subpixel", static_cast<double>(statistics.primary_rays) / subpixels},
         {"rays_left_out_per_subpixel",
          static_cast<double>(statistics.prefilter_rays_left_out) / subpixels},
         {"mse", frames::compare_pictures(ground_truth_.view(), frame_.view()).total.mse()},
         {"mse_beyond", mse_where(ground_truth_, frame_, beyond_, true)},
         {"mse_within", mse_where(ground_truth_, frame_, beyond_, false)},
         {"seen_mse", seen_mse},
         {"flip_mean", flip},
         {"flicker_frames", flicker},
         {"flicker_views", flicker_of_views()}});
    if (!flags_.pictures.empty())
      one.worst.add(number, ground_truth_.view(), frame_.view(), eyes_.reference(), eyes_.test());
  }

  /// Returns the mean change of an eye's error when the eye moves by one view.
  [[nodiscard]] double flicker_of_views() const {
    const int views = frames::native_view_count(model_.rig());
    frames::FlickerMeter meter;
    double sum = 0.0;
    for (int view = 0; view < views; ++view)
      sum += meter
                 .add(frames::decode_view(ground_truth_.view(), model_, view, views).view(),
                      frames::decode_view(frame_.view(), model_, view, views).view())
                 .mean;
    return sum / std::max(views - 1, 1);
  }

  const DepthBenchFlags& flags_;
  std::string name_;
  optics::OpticalModel model_;
  frames::BandWorkers workers_;
  ErrorEyes eyes_;
  SceneSequence scenes_;
  StageSequence stages_;
  frames::WovenFrame ground_truth_, beyond_, frame_;
  double share_beyond_ = 0.0;
  std::vector<Contender> contenders_;
};

/// Prints the means of the frames' figures, separately for subpixels beyond and within the depth of
/// field.
void print_scenario(const nlohmann::json& scenario) {
  print_out("{}, {}, {:g} depths of field: {:.0f} % outside one; ground truth: {} rays\n",
            scenario["scene"].get<std::string>(), scenario["rig"].get<std::string>(),
            scenario["depth_budget"].get<double>(), 100.0 * scenario["share_beyond"].get<double>(),
            scenario["truth_rays"].get<int>());
  print_out("  {:<11} {:>7} {:>6} {:>6} {:>8} {:>7} {:>7} {:>7} {:>7} {:>8} {:>8}\n", "", "cpu s",
            "times", "rays", "left out", "PSNR", "beyond", "seen", "FLIP", "frames", "views");
  double first_cpu_s = 0.0;
  for (const auto& way : scenario["ways"]) {
    const auto& frames = way["frames"];
    if (frames.empty()) continue;
    const auto mean = [&](const char* key, size_t from = 0) {
      double sum = 0.0;
      for (size_t n = from; n < frames.size(); ++n) sum += frames[n][key].get<double>();
      return sum / static_cast<double>(std::max<size_t>(frames.size() - from, 1));
    };
    const double cpu_s = mean("cpu_s");
    if (first_cpu_s == 0.0) first_cpu_s = cpu_s;
    print_out(
        "  {:<11} {:>7.2f} {:>6.2f} {:>6.2f} {:>8.2f} {:>7} {:>7} {:>7} {:>7.4f} {:>8.3f} "
        "{:>8.3f}\n",
        way["name"].get<std::string>(), cpu_s, cpu_s / first_cpu_s, mean("rays_per_subpixel"),
        mean("rays_left_out_per_subpixel"), decibels(psnr_or_null(mean("mse"))),
        decibels(psnr_or_null(mean("mse_beyond"))), decibels(psnr_or_null(mean("seen_mse"))),
        mean("flip_mean"), mean("flicker_frames", 1), mean("flicker_views"));
  }
  print_out("\n");
}

}  // namespace

Run declare_bench_depth(CLI::App& app) {
  auto flags = std::make_shared<DepthBenchFlags>();
  app.add_option("scenes", flags->scenes, "built-in scenes, as for render")->capture_default_str();
  app.add_option("--rig", flags->rig,
                 "rig file (default: the 4K kiosk with pixels six times as wide)");
  app.add_option("--depth-budget", flags->budget, "depth budgets of the scenes, in depths of field")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--frames", flags->frames, "number of consecutive frames of the animation")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--step", flags->step, "step from one of these frames to the next")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--truth", flags->ground_truth, "rays per subpixel of the ground truth")
      ->check(CLI::Range(3, 1024))
      ->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--pictures", flags->pictures,
                 "folder for pictures of the worst places: ground truth, method, difference; "
                 "below, what an eye sees");
  app.add_flag("--quick", flags->quick, "measure only the first scene, with very large pixels");
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags]() -> ExitCode {
    optics::Rig rig = flags->rig.empty() ? coarser_rig(kiosk_rig(), 6) : bench_rig(flags->rig);
    if (flags->quick) {
      flags->scenes.resize(1);
      rig = coarser_rig(rig, std::max(1, rig.panel.width_px / 240));
    }
    nlohmann::json scenarios = nlohmann::json::array();
    Progress progress("depth", "frames",
                      flags->scenes.size() * static_cast<uint64_t>(flags->frames));
    uint64_t frames_done = 0;
    for (const std::string& scene : flags->scenes) {
      if (interrupted()) break;
      scenarios.push_back(
          DepthScenario(*flags, rig, scene).run([&] { progress.update(++frames_done); }));
      if (!flags->json) print_scenario(scenarios.back());
    }
    progress.finish();
    if (flags->json) print_json({{"machine", machine_json()}, {"courses", scenarios}});
    return interrupt_exit_code();
  };
}

}  // namespace lenticule::player
