// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/bench_scene.h"

#include <algorithm>
#include <fstream>
#include <string>
#include <string_view>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "lab/stability/probes.h"
#include "player/process/interrupt.h"
#include "scenes/scene_list.h"

namespace lenticule::bench {

namespace {

render::SceneDescription load(const BenchSetup& setup, int& dropped_lights) {
  const tools::SceneSequence scenes(setup.scene, frames::Rate{});
  render::SceneDescription description = scenes.at(scenes.reference_frame());
  const auto kept = static_cast<size_t>(setup.lights);
  if (setup.lights > 0 && description.lights.size() > kept) {
    dropped_lights = static_cast<int>(description.lights.size() - kept);
    description.lights.resize(kept);
  }
  return description;
}

}  // namespace

BenchScene::BenchScene(const BenchSetup& setup)
    : setup_(setup),
      model_(setup.rig),
      description_(load(setup, dropped_lights_)),
      stage_(render::make_stage(description_, model_)),
      scene_(description_, stage_, {}, setup.threads),
      frame_({setup.rig.panel.width_px, setup.rig.panel.height_px, frames::PixelFormat::Rgb8}) {}

uint64_t BenchScene::primitives() const {
  uint64_t count = description_.spheres.size() + description_.cones.size();
  for (const render::TriangleMesh& mesh : description_.meshes) count += mesh.triangles.size();
  return count;
}

uint64_t BenchScene::subpixels() const {
  const optics::Panel& panel = setup_.rig.panel;
  return uint64_t{3} * static_cast<uint64_t>(panel.width_px) *
         static_cast<uint64_t>(panel.height_px);
}

render::RenderOptions BenchScene::options(int max_depth) const {
  return {.threads = setup_.threads, .max_depth = max_depth, .cancelled = player::interrupted};
}

std::unique_ptr<render::Method> BenchScene::method(const render::RenderOptions& options) const {
  return render::make_method("full", model_, options);
}

render::RenderStatistics BenchScene::render(render::Method& method) {
  return method.render(scene_, stage_, frame_);
}

std::string bench_scene_name(const std::string& name) {
  const std::string_view base = std::string_view(name).substr(0, name.find(':'));
  const auto& list = scenes::scene_list();
  const bool built_in = std::any_of(list.begin(), list.end(),
                                    [base](const auto& scene) { return base == scene.name; });
  return built_in ? "builtin:" + name : name;
}

namespace {

void time_visibility(const TimedCase& timed, CaseTimes& times) {
  const BenchScene& scene = *timed.scene;
  reset_peak_resident();
  const lab::VisibilityTiming timing =
      lab::time_visibility(scene.scene(), scene.model(), timed.options.threads);
  times.visibility_peak_mib = std::max(times.visibility_peak_mib, peak_resident_mib());
  times.bare.push_back(timing.bare_seconds);
  times.visibility.push_back(timing.pass_seconds);
}

void time_frame(const TimedCase& timed, render::Method& method, CaseTimes& times) {
  reset_peak_resident();
  times.statistics = timed.scene->render(method);
  times.frame_peak_mib = std::max(times.frame_peak_mib, peak_resident_mib());
  times.frame.push_back(times.statistics.seconds);
}

}  // namespace

std::vector<CaseTimes> time_by_turns(const std::vector<TimedCase>& cases, int runs) {
  std::vector<std::unique_ptr<render::Method>> methods;
  methods.reserve(cases.size());
  for (const TimedCase& timed : cases) methods.push_back(timed.scene->method(timed.options));
  std::vector<CaseTimes> times(cases.size());
  for (int run = 0; run < runs; ++run) {
    for (size_t i = 0; i < cases.size(); ++i) {
      if (player::interrupted()) return times;
      const size_t turn = run % 2 == 0 ? i : cases.size() - 1 - i;
      if (cases[turn].with_visibility) time_visibility(cases[turn], times[turn]);
      time_frame(cases[turn], *methods[turn], times[turn]);
    }
  }
  return times;
}

double peak_resident_mib() {
  std::ifstream status("/proc/self/status");
  const std::string key = "VmHWM:";
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key)) return std::stod(line.substr(key.size())) / 1024.0;
  return 0.0;
}

void reset_peak_resident() {
  std::ofstream("/proc/self/clear_refs") << "5";
}
}  // namespace lenticule::bench
