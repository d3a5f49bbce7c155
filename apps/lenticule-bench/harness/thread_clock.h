// SPDX-License-Identifier: Apache-2.0
// Measures processor time of a thread, which other programs disturb less than wall time.
#pragma once

#include <ctime>

namespace lenticule::bench {

[[nodiscard]] inline double clock_seconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// Returns the duration of `work` by a clock.
template <class Work>
[[nodiscard]] double seconds_by(clockid_t clock, Work&& work) {
  const double start = clock_seconds(clock);
  work();
  return clock_seconds(clock) - start;
}

/// Returns the processor time that `work` takes on this thread.
template <class Work>
[[nodiscard]] double thread_seconds(Work&& work) {
  return seconds_by(CLOCK_THREAD_CPUTIME_ID, work);
}

}  // namespace lenticule::bench
