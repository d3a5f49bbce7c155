// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/bench_scene.h"

#include <algorithm>
#include <fstream>
#include <string_view>

#include "apps/lenticule-tools/offline/scene_sequence.h"
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
      stage_(render::make_stage(description_, model_, {.whole_depth = true})),
      scene_(description_, stage_, {}, setup.threads),
      frame_({setup.rig.panel.width_px, setup.rig.panel.height_px, frames::PixelFormat::Rgb8}) {}

uint64_t BenchScene::primitives() const {
  uint64_t count = description_.spheres.size() + description_.cones.size();
  for (const render::TriangleMesh& mesh : description_.meshes)
    count += description_.shape_of(mesh).triangles.size();
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

double peak_resident_mib() {
  std::ifstream status("/proc/self/status");
  const std::string key = "VmHWM:";
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key)) return std::stod(line.substr(key.size())) / 1024.0;
  return 0.0;
}

void reset_peak_resident() { std::ofstream("/proc/self/clear_refs") << "5"; }
}  // namespace lenticule::bench
