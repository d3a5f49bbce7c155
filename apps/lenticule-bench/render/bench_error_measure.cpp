// SPDX-License-Identifier: Apache-2.0
// Renders a scenario with every method, frame by frame, and compares each with the reference.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_error.h"
#include "apps/lenticule-bench/render/bench_error_eyes.h"
#include "apps/lenticule-bench/render/bench_error_pictures.h"
#include "frames/compare.h"
#include "frames/measures/view_map.h"
#include "optics/model.h"
#include "player/process/interrupt.h"
#include "render/make_method.h"
#include "render/scene/scene.h"

namespace lenticule::bench {
namespace {

/// A method in one run; it may keep data of its last frame. Each has its own scene, because results
/// of culling are stored in the scene.
struct Racer {
  std::unique_ptr<render::Method> method;
  std::unique_ptr<render::Scene> scene;
};

/// One method in all runs.
struct Contestant {
  const ErrorEntrant* entrant = nullptr;
  std::vector<Racer> racers;
  std::vector<double> wall_s, cpu_s;  ///< times of the current frame, one number for each run
  render::RenderStatistics statistics;
  EyeFlicker flicker;
  WorstPlaces worst;
  nlohmann::json frames = nlohmann::json::array();
};

class ScenarioRun {
 public:
  ScenarioRun(const ErrorSetup& setup, const ErrorScene& scene, std::function<void()> done)
      : setup_(setup),
        scene_(scene),
        done_(std::move(done)),
        model_(setup.rig),
        workers_(setup.threads),
        views_(model_, frames::native_view_count(setup.rig), workers_),
        eyes_(model_, workers_),
        stages_(scene.after(0), model_, {}, setup.scenario == ErrorScenario::Turning ? 360.0 : 0.0),
        reference_(geometry()),
        frame_(geometry()) {
    for (const ErrorEntrant& entrant : setup.entrants)
      if (entrant.exists) add_contestant(entrant);
  }

  /// Returns false if interrupted.
  [[nodiscard]] bool run() {
    const bool moving = setup_.scenario != ErrorScenario::Still;
    const int frames = moving ? setup_.frames : 2;
    for (int n = 0; n < frames && !player::interrupted(); ++n) {
      if (moving || n == 0)
        set_scene(scene_.after(static_cast<uint64_t>(n)), static_cast<double>(n) / frames);
      frame(n);
    }
    return !player::interrupted();
  }

  [[nodiscard]] nlohmann::json result() {
    nlohmann::json pictures = nlohmann::json::array();
    nlohmann::json methods = nlohmann::json::array();
    for (const ErrorEntrant& entrant : setup_.entrants) {
      methods.push_back({{"name", entrant.name},
                         {"method", entrant.method},
                         {"tolerated_error", nullptr},
                         {"missing", !entrant.exists}});
      if (entrant.tolerated) methods.back()["tolerated_error"] = *entrant.tolerated;
      if (!entrant.exists) continue;
      Contestant& one = contestant_of(entrant);
      methods.back()["frames"] = std::move(one.frames);
      if (!setup_.pictures.empty())
        for (nlohmann::json& picture : one.worst.write(setup_.pictures, stem_of(entrant)))
          pictures.push_back(std::move(picture));
    }
    return {{"scene", scene_.name()},
            {"rig", setup_.rig.name},
            {"course", name_of(setup_.scenario)},
            {"subpixels", geometry().frame_bytes()},
            {"copy_s", std::ranges::min(copy_s_)},
            {"pictures", std::move(pictures)},
            {"methods", std::move(methods)}};
  }

 private:
  [[nodiscard]] frames::FrameGeometry geometry() const {
    return {setup_.rig.panel.width_px, setup_.rig.panel.height_px, frames::PixelFormat::Rgb8};
  }
  [[nodiscard]] std::string stem_of(const ErrorEntrant& entrant) const {
    return fmt::format("{}-{}x{}-{}-{}", scene_.name(), geometry().width, geometry().height,
                       name_of(setup_.scenario), entrant.name);
  }

  void add_contestant(const ErrorEntrant& entrant) {
    render::RenderOptions options;
    options.threads = setup_.threads;
    options.max_depth = setup_.depth;
    options.soft = setup_.soft;
    options.cancelled = [] { return player::interrupted(); };
    if (entrant.tolerated) options.tolerated_error = *entrant.tolerated;
    options.proven_rmse = entrant.proven_rmse;
    Contestant& one = contestants_.emplace_back();
    one.entrant = &entrant;
    for (int run = 0; run < setup_.runs; ++run)
      one.racers.push_back({render::make_method(entrant.method, model_, options), nullptr});
  }

  Contestant& contestant_of(const ErrorEntrant& entrant) {
    return *std::ranges::find(contestants_, &entrant, &Contestant::entrant);
  }

  void set_scene(render::SceneDescription description, double progress) {
    description_ = std::move(description);
    stage_ = stages_.at(description_, progress);
    for (Contestant& one : contestants_)
      for (Racer& racer : one.racers) racer.scene.reset();
  }

  /// Measures a frame. The reference is first in the first run, because the others are compared
  /// with it; after that the runs are interleaved, every second one in reverse order.
  void frame(int number) {
    for (Contestant& one : contestants_) one.wall_s = one.cpu_s = {};
    for (int run = 0; run < setup_.runs; ++run) {
      time_copies();
      for (size_t i = 0; i < contestants_.size(); ++i) {
        const size_t turn = run % 2 == 0 ? i : contestants_.size() - 1 - i;
        if (!race(contestants_[turn], run, number)) return;
        if (run == 0) measure(contestants_[turn], number);
        if (run == 0) done_();
      }
    }
    for (Contestant& one : contestants_) {
      one.frames.back()["wall_s"] = median(one.wall_s);
      one.frames.back()["cpu_s"] = median(one.cpu_s);
    }
  }

  /// Renders one frame. A still scene is committed once, a moving one for each frame; neither is
  /// timed.
  [[nodiscard]] bool race(Contestant& one, int run, int number) {
    Racer& racer = one.racers[static_cast<size_t>(run)];
    if (!racer.scene)
      racer.scene = std::make_unique<render::Scene>(description_, stage_, render::Surroundings{},
                                                    setup_.threads);
    racer.method->set_frame(static_cast<uint64_t>(number));
    const double cpu = process_cpu_seconds();
    const double start = seconds_now();
    one.statistics = racer.method->render(*racer.scene, stage_, frame_);
    one.wall_s.push_back(seconds_now() - start);
    one.cpu_s.push_back(process_cpu_seconds() - cpu);
    return one.statistics.completed;
  }

  /// Measures the time to copy a frame with as many threads, a lower bound for writing one. The
  /// fastest copy counts.
  void time_copies() {
    constexpr int kTimes = 5;
    for (int n = 0; n < kTimes; ++n) time_copy();
  }

  void time_copy() {
    const auto bands = static_cast<size_t>(workers_.count());
    const size_t bytes = reference_.bytes().size();
    const double start = seconds_now();
    workers_.run(workers_.count(), [&](int band, int) {
      const size_t begin = bytes * static_cast<size_t>(band) / bands;
      const size_t end = bytes * static_cast<size_t>(band + 1) / bands;
      std::memcpy(frame_.bytes().data() + begin, reference_.bytes().data() + begin, end - begin);
    });
    copy_s_.push_back(seconds_now() - start);
  }

  void measure(Contestant& one, int number) {
    const render::RenderStatistics& s = one.statistics;
    nlohmann::json figures = {
        {"rays", all_rays(s)}, {"traced", s.traced_subpixels}, {"subpixels", s.subpixels}};
    if (s.audited_subpixels > 0)
      figures.update({{"audited", s.audited_subpixels},
                      {"audited_beyond", s.audited_beyond},
                      {"bound", s.beyond_bound},
                      {"rmse_bound", s.rmse_bound}});
    if (&one == contestants_.data()) {
      std::swap(reference_, frame_);
      eyes_.set_reference(reference_.view());
    } else {
      add_errors(one, figures);
      figures["eyes"] = eyes_.compare(frame_.view(), one.flicker);
      if (!setup_.pictures.empty())
        one.worst.add(number, reference_.view(), frame_.view(), eyes_.reference(), eyes_.test());
    }
    one.frames.push_back(std::move(figures));
  }

  void add_errors(const Contestant& one, nlohmann::json& figures) {
    const std::vector<frames::Difference> views =
        views_.compare(reference_.view(), frame_.view(), workers_);
    frames::Difference total;
    for (const frames::Difference& view : views) total.add(view);
    figures["mse"] = total.mse();
    figures["max"] = total.max();
    figures["share_over_8"] = total.share_over(8);
    figures["share_over_32"] = total.share_over(32);
    // Codes are integers, so "more than E" equals "more than E rounded down".
    if (one.entrant->tolerated)
      figures["share_over_e"] = total.share_over(static_cast<int>(*one.entrant->tolerated));
    figures["worst_view_mse"] = views[static_cast<size_t>(frames::worst_view(views))].mse();
  }

  const ErrorSetup& setup_;
  const ErrorScene& scene_;
  std::function<void()> done_;
  optics::OpticalModel model_;
  frames::BandWorkers workers_;
  frames::ViewMap views_;
  ErrorEyes eyes_;
  tools::StageSequence stages_;
  render::SceneDescription description_;
  render::Stage stage_;
  frames::WovenFrame reference_;
  frames::WovenFrame frame_;  ///< the frame rendered last, by any method
  std::vector<double> copy_s_;
  std::vector<Contestant> contestants_;
};

}  // namespace

nlohmann::json measure_error(const ErrorSetup& setup, const ErrorScene& scene,
                             const std::function<void()>& done) {
  ScenarioRun scenario(setup, scene, done);
  if (!scenario.run()) return {};
  return scenario.result();
}

}  // namespace lenticule::bench
