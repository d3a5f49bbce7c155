// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_clock.h"

#include <sys/timex.h>

#include <cstdlib>
#include <ctime>

namespace lenticule::player {
namespace {

using std::chrono::nanoseconds;

/// Two clocks are not read at the same moment; a smaller change is no step.
constexpr nanoseconds kLeastStep = std::chrono::milliseconds(1);

nanoseconds read_clock(clockid_t clock) noexcept {
  timespec time{};
  (void)::clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

}  // namespace

ClockReading read_clocks() noexcept {
  return {.monotonic = read_clock(CLOCK_MONOTONIC), .real = read_clock(CLOCK_REALTIME)};
}

StepClock::StepClock(const ClockReading& start) noexcept : ahead_(start.real - start.monotonic) {}

StepNow StepClock::now(const ClockReading& reading) noexcept {
  const nanoseconds stepped = reading.real - reading.monotonic - ahead_;
  if (std::chrono::abs(stepped - stepped_) >= kLeastStep) {
    stepped_ = stepped;
    ++steps_;
  }
  return {.monotonic = reading.monotonic, .group = reading.monotonic + ahead_, .stepped = stepped_};
}

ClockAccuracy read_clock_accuracy() noexcept {
  timex answer{};
  const int state = ::adjtimex(&answer);
  if (state < 0) return {};
  return {.known = true,
          .synchronised = state != TIME_ERROR && (answer.status & STA_UNSYNC) == 0,
          .offset_us = (answer.status & STA_NANO) != 0 ? answer.offset / 1000 : answer.offset,
          .estimated_us = answer.esterror,
          .bound_us = answer.maxerror};
}

}  // namespace lenticule::player
