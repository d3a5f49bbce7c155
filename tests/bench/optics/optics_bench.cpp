// SPDX-License-Identifier: Apache-2.0
// Measures the subpixel-to-ray map: each instruction set, with and without a residual map, against
// the scalar model. items_per_second are subpixels.
#include <benchmark/benchmark.h>

#include <random>

#include "optics/eye_simulator.h"
#include "optics/row_rays.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

Rig bench_rig(bool residual) {
  Rig rig = test::kiosk_rig();
  std::mt19937_64 random(1);
  if (residual) rig.sheet.residual = test::random_residual(random, 11, 7, 0.1);
  return rig;
}

void row_rays(benchmark::State& state, Isa isa, bool residual) {
  if (!isa_supported(isa)) {
    state.SkipWithError("this machine cannot run it");
    return;
  }
  const OpticalModel model(bench_rig(residual));
  const RowRayEvaluator evaluator(model, isa);
  RowRays rays;
  int j = 0;
  for (auto _ : state) {
    evaluator.evaluate(j, 0, 3840, rays);
    benchmark::DoNotOptimize(rays.tan_x.data());
    j = (j + 7) % 2160;
  }
  state.SetItemsProcessed(state.iterations() * 3 * 3840);
}
BENCHMARK_CAPTURE(row_rays, baseline, Isa::Baseline, false);
BENCHMARK_CAPTURE(row_rays, avx2, Isa::Avx2, false);
BENCHMARK_CAPTURE(row_rays, avx512, Isa::Avx512, false);
BENCHMARK_CAPTURE(row_rays, baseline_residual, Isa::Baseline, true);
BENCHMARK_CAPTURE(row_rays, avx2_residual, Isa::Avx2, true);
BENCHMARK_CAPTURE(row_rays, avx512_residual, Isa::Avx512, true);

void scalar_model(benchmark::State& state, bool residual) {
  const OpticalModel model(bench_rig(residual));
  int i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(model.ray(i % 3840, 700, i % 3));
    ++i;
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(scalar_model, perfect, false);
BENCHMARK_CAPTURE(scalar_model, residual, true);

void eye_picture(benchmark::State& state) {
  const OpticalModel model(bench_rig(false));
  const std::vector<uint8_t> pixels(size_t{3} * 3840 * 2160, 100);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        simulate_eye(model, {pixels.data(), 3840, 2160, 3 * 3840}, {-32.0, 0.0, 700.0}));
  }
}
BENCHMARK(eye_picture)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace lenticule::optics
