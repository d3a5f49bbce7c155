// SPDX-License-Identifier: Apache-2.0
// BenchScene is a scene prepared for one rig as `render` does it, the start of every rendering
// benchmark; the functions after it read clocks and memory.
#pragma once

#include <ctime>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::bench {

struct BenchSetup {
  std::string scene;  ///< a scene as for render
  optics::Rig rig;
  int lights = 0;   ///< maximum number of lights; the rest is dropped; 0 = no limit
  int threads = 0;  ///< 0 = all cores
};

class BenchScene {
 public:
  /// Throws the errors of loading, placing and committing the scene.
  explicit BenchScene(const BenchSetup& setup);
  BenchScene(const BenchScene&) = delete;
  BenchScene& operator=(const BenchScene&) = delete;

  [[nodiscard]] const BenchSetup& setup() const { return setup_; }
  [[nodiscard]] const optics::OpticalModel& model() const { return model_; }
  /// Returns the description without the dropped lights.
  [[nodiscard]] const render::SceneDescription& description() const { return description_; }
  [[nodiscard]] const render::Scene& scene() const { return scene_; }
  [[nodiscard]] int dropped_lights() const { return dropped_lights_; }
  [[nodiscard]] uint64_t primitives() const;
  [[nodiscard]] uint64_t subpixels() const;

  /// Returns options with the setup's threads and interruption.
  [[nodiscard]] render::RenderOptions options(int max_depth) const;
  /// Returns method "full" with the given options, including threads and interruption.
  [[nodiscard]] std::unique_ptr<render::Method> method(const render::RenderOptions& options) const;
  /// Renders a frame, which frame() returns until the next call.
  render::RenderStatistics render(render::Method& method);
  [[nodiscard]] const frames::WovenFrame& frame() const { return frame_; }

 private:
  BenchSetup setup_;
  optics::OpticalModel model_;
  int dropped_lights_ = 0;
  render::SceneDescription description_;
  render::Stage stage_;
  render::Scene scene_;
  frames::WovenFrame frame_;
};

/// Returns a scene name, with "builtin:" added to a built-in scene's name.
[[nodiscard]] std::string bench_scene_name(const std::string& name);

/// Returns the peak resident memory of this process in MiB since the last reset; since the start if
/// the kernel does not permit the reset.
[[nodiscard]] double peak_resident_mib();
void reset_peak_resident();

[[nodiscard]] inline double mega_per_second(uint64_t count, double seconds) {
  return seconds > 0.0 ? static_cast<double>(count) / seconds / 1e6 : 0.0;
}
[[nodiscard]] inline double nanoseconds_each(uint64_t count, double seconds) {
  return count > 0 ? seconds * 1e9 / static_cast<double>(count) : 0.0;
}
[[nodiscard]] inline uint64_t all_rays(const render::RenderStatistics& statistics) {
  return statistics.primary_rays + statistics.shadow_rays + statistics.secondary_rays;
}

/// Returns the time of a clock; only differences are meaningful. CLOCK_MONOTONIC is wall time,
/// CLOCK_PROCESS_CPUTIME_ID and CLOCK_THREAD_CPUTIME_ID are processor time, which other programs
/// disturb less.
[[nodiscard]] inline double clock_seconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}
[[nodiscard]] inline double seconds_now() { return clock_seconds(CLOCK_MONOTONIC); }
[[nodiscard]] inline double process_cpu_seconds() {
  return clock_seconds(CLOCK_PROCESS_CPUTIME_ID);
}

/// Returns the duration of `work` by a clock.
template <class Work>
[[nodiscard]] double seconds_by(clockid_t clock, Work&& work) {
  const double start = clock_seconds(clock);
  work();
  return clock_seconds(clock) - start;
}

}  // namespace lenticule::bench
