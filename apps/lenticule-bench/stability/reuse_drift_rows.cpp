// SPDX-License-Identifier: Apache-2.0
// Runs methods that carry data from frame to frame over very many frames: errors and memory must
// not accumulate, and a frame in the middle must equal the same frame rendered alone.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"
#include "frames/compare.h"
#include "player/playback/play_statistics.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

constexpr double kMmPerUnit = 6.0;
constexpr int kWindows = 10;
/// Frame numbers exceed 32 bits from the middle of the run on.
constexpr uint64_t kMiddleFrame = uint64_t{1} << 32;
constexpr double kMib = 1024.0 * 1024.0;

/// Returns a rig of one render tile, because there are many frames.
optics::Rig rig() {
  optics::Rig rig = small_rig();
  rig.panel.width_px = 112;
  rig.panel.height_px = 16;
  return rig;
}

/// Returns a scene about 5 units wide that is cheap to trace.
render::SceneDescription drifting_scene() {
  render::SceneDescription scene;
  scene.source = "drift";
  scene.colour_managed = false;
  scene.background = {0.11, 0.23, 0.37};
  scene.materials = {render::Material{.name = "matte", .colour = {0.8, 0.75, 0.6}},
                     render::Material{.name = "gloss",
                                      .colour = {0.9, 0.4, 0.3},
                                      .diffuse = 0.7,
                                      .specular = 0.2,
                                      .shine = 23.0}};
  scene.meshes = {grid_mesh({-4.53, -0.71, 1.57}, {9.11, 0.07, 0.0}, {0.0, 0.95, -3.3}, 1),
                  ball_mesh({0.81, 0.33, 0.31}, 0.61, 5)};
  scene.spheres = {{.centre = {-0.71, -0.13, 0.22}, .radius = 0.67, .material = 1}};
  render::Light sun;
  sun.kind = render::Light::Kind::Directional;
  sun.direction = normalized(Vec3{-0.53, -0.71, -0.43});
  sun.colour = {0.6, 0.65, 0.7};
  scene.lights = {sun};
  return scene;
}

/// Returns the placement in a frame: the scene moves on a path that never closes, and stands still
/// from time to time.
render::Stage stage_of(uint64_t frame) {
  constexpr uint64_t kRound = 256, kMoving = 208;
  const auto moves =
      static_cast<double>(frame / kRound * kMoving + std::min(frame % kRound, kMoving));
  const auto wave = [&](double period) {
    return std::sin(2.0 * std::numbers::pi * std::fmod(moves, period) / period);
  };
  return plain_stage({0.15 * wave(61.7), 0.1 * wave(47.3), 0.12 * wave(37.1)}, kMmPerUnit);
}

/// One method and the errors of its frames.
struct Racer {
  const char* name = "";
  render::ReuseOptions reuse{};
  std::unique_ptr<render::Method> method{};
  std::vector<double> window_errors{};  ///< mean squared errors, codes
  uint64_t copied_subpixels = 0;
};

class LongRun {
 public:
  explicit LongRun(const StabilitySize& size)
      : frames_(size.samples(2'000, 100'000)),
        asked_every_(size.samples(197, 997)),
        model_(rig()),
        description_(drifting_scene()),
        full_(method("full", {})) {
    racers_.push_back({.name = "temporal"});
    racers_.push_back({.name = "hybrid"});
    racers_.push_back({.name = "adaptive"});
    for (Racer& racer : racers_) {
      racer.method = method(racer.name, racer.reuse);
      racer.method->set_frame(first_frame());
    }
  }

  void run() {
    const uint64_t in_window = frames_ / kWindows;
    for (int window = 0; window < kWindows && !interrupted(); ++window) {
      // The method has allocated its memory by then.
      if (window == 1) memory_before_ = read_resident_memory().anonymous;
      for (Racer& racer : racers_) racer.window_errors.push_back(0.0);
      for (uint64_t n = 0; n < in_window && !interrupted(); ++n)
        render(first_frame() + static_cast<uint64_t>(window) * in_window + n);
      for (Racer& racer : racers_) racer.window_errors.back() /= static_cast<double>(in_window);
    }
    memory_after_ = read_resident_memory().anonymous;
  }

  StabilityRow row();

 private:
  [[nodiscard]] uint64_t first_frame() const { return kMiddleFrame - frames_ / 2; }

  [[nodiscard]] std::unique_ptr<render::Method> method(const char* name,
                                                       const render::ReuseOptions& reuse) const {
    return render::make_method(name, model_,
                               {.threads = 1,  // frames are smaller than a thread's share
                                .copy_unchanged = true,
                                .reuse = reuse,
                                .cancelled = interrupted});
  }

  SmallFrame frame_of(render::Method& method, uint64_t number) const {
    const render::Stage stage = stage_of(number);
    const render::Scene scene(description_, stage, {}, 1);
    return next_frame(method, scene, stage, model_.rig());
  }

  void render(uint64_t number) {
    const render::Stage stage = stage_of(number);
    const render::Scene scene(description_, stage, {}, 1);
    const SmallFrame ground_truth = next_frame(*full_, scene, stage, model_.rig());
    for (Racer& racer : racers_) {
      const SmallFrame made = next_frame(*racer.method, scene, stage, model_.rig());
      racer.window_errors.back() +=
          frames::compare_pictures(ground_truth.frame.view(), made.frame.view()).total.mse();
      racer.copied_subpixels += made.statistics.copied_subpixels;
      if (number % asked_every_ == 0)
        checks_.check(fmt::format("{} frame {}", racer.name, number),
                      made.frame == asked_for_alone(racer, number));
    }
    ++rendered_;
  }

  /// Renders the frame with a new method that has seen only the frames that it needs.
  [[nodiscard]] frames::WovenFrame asked_for_alone(const Racer& racer, uint64_t number) const {
    const auto fresh = method(racer.name, racer.reuse);
    for (uint64_t n = fresh->first_needed(number); n < number; ++n) {
      fresh->set_frame(n);
      (void)frame_of(*fresh, n);
    }
    fresh->set_frame(number);
    return frame_of(*fresh, number).frame;
  }

  uint64_t frames_;
  uint64_t asked_every_;
  optics::OpticalModel model_;
  render::SceneDescription description_;
  std::unique_ptr<render::Method> full_;
  std::vector<Racer> racers_;
  NamedFailures checks_;
  uint64_t rendered_ = 0;
  uint64_t memory_before_ = 0;
  uint64_t memory_after_ = 0;
};

/// Returns the trend of errors from window to window: the slope of the regression line, divided by
/// its standard error.
double trend_of(const std::vector<double>& errors) {
  const auto count = static_cast<double>(errors.size());
  double mean = 0.0;
  for (const double error : errors) mean += error / count;
  const double middle = (count - 1.0) / 2.0;
  double across = 0.0, along = 0.0;
  for (size_t n = 0; n < errors.size(); ++n) {
    const double x = static_cast<double>(n) - middle;
    across += x * (errors[n] - mean);
    along += x * x;
  }
  const double slope = across / along;
  double residual = 0.0;
  for (size_t n = 0; n < errors.size(); ++n) {
    const double off = errors[n] - mean - slope * (static_cast<double>(n) - middle);
    residual += off * off;
  }
  return slope / std::sqrt(residual / (count - 2.0) / along);
}

StabilityRow LongRun::row() {
  constexpr double kTrend = 4.0;  // standard errors: exceeded by chance once in ten thousand runs
  constexpr double kMemoryMib = 4.0;
  double worst = 0.0;
  std::string note;
  for (const Racer& racer : racers_) {
    const std::vector<double>& errors = racer.window_errors;
    double first = 0.0;
    for (int n = 0; n < kWindows / 5; ++n) first += errors[static_cast<size_t>(n)] * 5.0 / kWindows;
    const double trend = trend_of(errors);
    const double last = *std::max_element(errors.begin(), errors.end());
    checks_.check(fmt::format("{}'s trend", racer.name), trend < kTrend);
    worst = std::max(worst, last / first);
    note += fmt::format("{} {:.2f} codes, trend {:+.1f}; ", racer.name, std::sqrt(first), trend);
  }
  checks_.check("unchanged frames were copied", racers_.back().copied_subpixels > 0);
  const double grown =
      (static_cast<double>(memory_after_) - static_cast<double>(memory_before_)) / kMib;
  checks_.check("memory", grown < kMemoryMib);
  note += fmt::format("{} checks, memory {:+.1f} MiB", checks_.tally.samples, grown);
  if (!checks_.names().empty()) note += "; " + checks_.names();
  return {.stressed = "one run of temporal, hybrid, adaptive, through frame 2^32, against full",
          .samples = rendered_ * racers_.size(),
          .samples_are = "frames",
          .failures = checks_.tally.failures,
          .failures_are = "frames that differ when rendered alone, trends or leaks",
          .worst = worst,
          .bound = 1.5,
          .unit = "times the first fifth's",
          .note = note};
}

}  // namespace

StabilityRow stability_reuse_drift(const StabilitySize& size) {
  LongRun run(size);
  run.run();
  return run.row();
}

}  // namespace lenticule::player
