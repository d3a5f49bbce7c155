// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/bench_timing.h"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <string>

#include "lab/stability/probes.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
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

double seconds_now() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

double process_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void reset_peak_resident() {
  std::ofstream("/proc/self/clear_refs") << "5";
}

}  // namespace lenticule::bench
