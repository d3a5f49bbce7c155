// SPDX-License-Identifier: Apache-2.0
// Measures parts of the renderer on small inputs; `lenticule bench exact` measures whole frames.
#include <benchmark/benchmark.h>

#include "render/methods/method.h"
#include "render/rays/primary_rays.h"
#include "render/shading/shading.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

optics::Rig bench_panel() { return test::make_rig({.width = 320, .height = 160, .pixel_mm = 0.2}); }

const SceneDescription& tiny_scene(size_t index) {
  static const std::vector<test::NamedScene> scenes = test::tiny_scenes();
  return scenes[index].scene;
}

void making_rays(benchmark::State& state) {
  const optics::OpticalModel model(bench_panel());
  const TilePlan plan(model.rig());
  const PrimaryRays primary(model, plan);
  const Scene scene(tiny_scene(0), test::make_tiny_stage(), {}, 1);
  const Footprint centre(model, {});
  PrimaryRays::Workspace workspace;
  std::vector<PathRay> rays;
  for (auto _ : state) {
    primary.generate(scene, plan.tile(1), centre, 1.0, workspace, rays);
    benchmark::DoNotOptimize(rays.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(rays.size()));
}
BENCHMARK(making_rays);

/// The scenes contain spheres, cones, meshes, mirrors and glass: see tests/support/tiny_scenes.h.
void whole_frame(benchmark::State& state) {
  const optics::OpticalModel model(bench_panel());
  const Scene scene(tiny_scene(static_cast<size_t>(state.range(0))), test::make_tiny_stage(), {},
                    1);
  const auto method = make_method("full", model, {.threads = 1, .cancelled = {}});
  frames::WovenFrame frame({model.rig().panel.width_px, model.rig().panel.height_px});
  for (auto _ : state) {
    RenderStatistics statistics = method->render(scene, {}, frame);
    benchmark::DoNotOptimize(statistics.primary_rays);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(frame.bytes().size()));
}
BENCHMARK(whole_frame)->DenseRange(0, 4)->Unit(benchmark::kMillisecond);

void meeting_a_sphere(benchmark::State& state) {
  const SphereShape sphere{.centre = {1, 2, 3}, .radius = 2.0};
  Vec3 origin{20, 1, 2};
  for (auto _ : state) {
    benchmark::DoNotOptimize(origin);
    Roots roots = meet(sphere, origin, {-1, 0.02, 0.03});
    benchmark::DoNotOptimize(roots);
  }
}
BENCHMARK(meeting_a_sphere);

}  // namespace
}  // namespace lenticule::render
