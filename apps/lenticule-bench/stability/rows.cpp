// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/stability/rows.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

#include "player/process/interrupt.h"

namespace lenticule::bench {

StabilityRow stability_phase_scalar(const StabilitySize& size);
StabilityRow stability_phase_kernels(const StabilitySize& size);
StabilityRow stability_phase_tiles(const StabilitySize& size);
StabilityRow stability_borders(const StabilitySize& size);
StabilityRow stability_borders_tiles(const StabilitySize& size);
StabilityRow stability_offsets(const StabilitySize& size);
StabilityRow stability_scales(const StabilitySize& size);
StabilityRow stability_degenerate(const StabilitySize& size);
StabilityRow stability_corners(const StabilitySize& size);
StabilityRow stability_edges(const StabilitySize& size);
StabilityRow stability_inside(const StabilitySize& size);
StabilityRow stability_shadow_triangle(const StabilitySize& size);
StabilityRow stability_shadow_sphere(const StabilitySize& size);
StabilityRow stability_shadow_cone(const StabilitySize& size);
StabilityRow stability_shadow_cylinder(const StabilitySize& size);
StabilityRow stability_shadow_far(const StabilitySize& size);
StabilityRow stability_coplanar(const StabilitySize& size);
StabilityRow stability_grazing(const StabilitySize& size);
StabilityRow stability_eye_on_panel(const StabilitySize& size);
StabilityRow stability_through_eye(const StabilitySize& size);
StabilityRow stability_total_reflection(const StabilitySize& size);
StabilityRow stability_nested_glass(const StabilitySize& size);
StabilityRow stability_outline_slopes(const StabilitySize& size);
StabilityRow stability_audit(const StabilitySize& size);

const std::vector<StabilityCase>& stability_cases() {
  static const std::vector<StabilityCase> table = {
      {"phase-scalar", stability_phase_scalar},
      {"phase-kernels", stability_phase_kernels},
      {"phase-tiles", stability_phase_tiles},
      {"borders", stability_borders},
      {"borders-tiles", stability_borders_tiles},
      {"offsets", stability_offsets},
      {"scales", stability_scales},
      {"degenerate", stability_degenerate},
      {"corners", stability_corners},
      {"edges", stability_edges},
      {"inside", stability_inside},
      {"shadow-triangle", stability_shadow_triangle},
      {"shadow-sphere", stability_shadow_sphere},
      {"shadow-cone", stability_shadow_cone},
      {"shadow-cylinder", stability_shadow_cylinder},
      {"shadow-far", stability_shadow_far},
      {"coplanar", stability_coplanar},
      {"grazing", stability_grazing},
      {"eye-on-glass", stability_eye_on_panel},
      {"through-eye", stability_through_eye},
      {"total-reflection", stability_total_reflection},
      {"nested-glass", stability_nested_glass},
      {"outline-slopes", stability_outline_slopes},
      {"audit", stability_audit},
  };
  return table;
}

void for_each_part(const StabilitySize& size, uint64_t count,
                   const std::function<void(uint64_t)>& work) {
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  const unsigned threads = size.threads > 0 ? static_cast<unsigned>(size.threads) : cores;
  std::atomic<uint64_t> next{0};
  std::mutex mutex;
  std::exception_ptr first_error;
  const auto run = [&] {
    try {
      for (uint64_t k = next++; k < count && !player::interrupted(); k = next++) work(k);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!first_error) first_error = std::current_exception();
      next = count;
    }
  };
  std::vector<std::jthread> others;
  for (unsigned k = 1; k < threads; ++k) others.emplace_back(run);
  run();
  others.clear();
  if (first_error) std::rethrow_exception(first_error);
}

}  // namespace lenticule::bench
