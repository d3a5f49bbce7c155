// SPDX-License-Identifier: Apache-2.0
// Times frames that are to be compared by turns, so that what else the machine does falls on all of
// them alike.
#pragma once

#include <vector>

#include "apps/lenticule-bench/harness/bench_scene.h"

namespace lenticule::player {

struct TimedCase {
  BenchScene* scene = nullptr;
  render::RenderOptions options;
  bool with_visibility = true;  ///< bare Embree and visibility are timed too
};

/// One number per run, in wall seconds.
struct CaseTimes {
  std::vector<double> bare;
  std::vector<double> visibility;
  std::vector<double> frame;
  render::RenderStatistics statistics;  ///< of the last frame
  /// The most memory that the process had resident while these ran, in MiB.
  double visibility_peak_mib = 0.0;
  double frame_peak_mib = 0.0;
};

/// `runs` rounds of one run of each case. Every second round goes the other way round, since what
/// comes later finds warmer caches and a warmer processor. Ends early when interrupted.
[[nodiscard]] std::vector<CaseTimes> time_by_turns(const std::vector<TimedCase>& cases, int runs);

/// Peak resident memory of this process since the last reset, in MiB; without a reset where the
/// kernel does not let us.
[[nodiscard]] double peak_resident_mib();
void reset_peak_resident();

/// On a clock that only goes forward; differences count.
[[nodiscard]] double seconds_now();
/// Processor time of all threads of this process.
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

}  // namespace lenticule::player
