// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/exposure_clock.h"

#include <algorithm>
#include <chrono>

namespace lenticule::calib {
namespace {

constexpr Nanoseconds kOldestStamp = std::chrono::seconds{10};
/// Tolerance in addition to the time of a frame: some drivers compute the expected end of the
/// frame.
constexpr Nanoseconds kAheadAllowed = std::chrono::milliseconds{5};

}  // namespace

Nanoseconds ExposureClock::exposed_at(const BufferStamp& stamp, Nanoseconds now) {
  const bool plausible = stamp.monotonic && stamp.time <= now + frame_ + kAheadAllowed &&
                         stamp.time > now - kOldestStamp && stamp.time >= last_stamp_;
  const Nanoseconds half = (frame_ + exposure_) / 2;
  if (!plausible) {
    unreliable_ = true;
    return now - half;
  }
  last_stamp_ = stamp.time;
  return std::min(stamp.start_of_exposure ? stamp.time + half : stamp.time - half, now);
}

uint64_t ExposureClock::count(uint32_t sequence) {
  if (!last_sequence_) {
    count_ = sequence;
  } else {
    const uint32_t gone_on = sequence - *last_sequence_;
    const bool backwards = gone_on == 0 || gone_on > UINT32_MAX / 2;
    count_ += backwards ? 1 : gone_on;
  }
  last_sequence_ = sequence;
  return count_;
}

}  // namespace lenticule::calib
