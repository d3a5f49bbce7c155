// SPDX-License-Identifier: Apache-2.0
// Times the cases to compare in interleaved runs, so that other load on the machine affects all
// cases equally.
#pragma once

#include <vector>

#include "apps/lenticule-bench/harness/bench_scene.h"

namespace lenticule::bench {

struct TimedCase {
  BenchScene* scene = nullptr;
  render::RenderOptions options;
  bool with_visibility = true;  ///< also times bare Embree and visibility
};

/// One number per run, in seconds of wall time.
struct CaseTimes {
  std::vector<double> bare;
  std::vector<double> visibility;
  std::vector<double> frame;
  render::RenderStatistics statistics;  ///< statistics of the last frame
  /// Peak resident memory of the process during these runs, in MiB.
  double visibility_peak_mib = 0.0;
  double frame_peak_mib = 0.0;
};

/// Runs `runs` rounds of one run of each case. Every second round has the reverse order, because
/// later cases find warmer caches and a warmer processor. Ends early when interrupted.
[[nodiscard]] std::vector<CaseTimes> time_by_turns(const std::vector<TimedCase>& cases, int runs);

/// Returns the peak resident memory of this process in MiB since the last reset; since the start if
/// the kernel does not permit the reset.
[[nodiscard]] double peak_resident_mib();
void reset_peak_resident();

/// Returns the time of a monotonic clock; only differences are meaningful.
[[nodiscard]] double seconds_now();
/// Returns the processor time of all threads of this process.
[[nodiscard]] double process_cpu_seconds();

[[nodiscard]] inline double mega_per_second(uint64_t count, double seconds) {
  return seconds > 0.0 ? static_cast<double>(count) / seconds / 1e6 : 0.0;
}
[[nodiscard]] inline double nanoseconds_each(uint64_t count, double seconds) {
  return count > 0 ? seconds * 1e9 / static_cast<double>(count) : 0.0;
}
[[nodiscard]] inline uint64_t all_rays(const render::RenderStatistics& statistics) {
  return statistics.primary_rays + statistics.shadow_rays + statistics.secondary_rays;
}

}  // namespace lenticule::bench
