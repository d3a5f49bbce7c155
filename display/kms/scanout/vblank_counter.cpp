// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/vblank_counter.h"

#include <algorithm>

namespace lenticule::display {
namespace {

/// A driver's timestamp may be that of the next active picture, or be reported late. A timestamp
/// beyond these limits is not a time.
constexpr Nanoseconds kMostInFuture = std::chrono::milliseconds(50);
constexpr Nanoseconds kMostInPast = std::chrono::seconds(1);

}  // namespace

VblankCounter::VblankCounter(Source source, frames::Rate refresh, Vblank now)
    : source_(source),
      refresh_(refresh),
      timeline_(now.time, refresh),
      base_(now.sequence),
      last_(now) {}

void VblankCounter::anchor(Vblank vblank) {
  timeline_ = VblankTimeline(vblank.time, refresh_);
  base_ = vblank.sequence;
}

void VblankCounter::use_software(Nanoseconds now) {
  if (source_ == Source::Software) return;
  last_ = last_until(now);
  source_ = Source::Software;
  anchor(last_);
}

void VblankCounter::rebase(Nanoseconds now) {
  if (source_ == Source::Hardware) rebasing_ = true;
  last_ = last_until(now);
  anchor(last_);
}

Vblank VblankCounter::observe_low_bits(uint32_t sequence, Nanoseconds time, Nanoseconds now) {
  // Chooses the nearest 64-bit number with these low bits: within half of 2^32 in either direction.
  const uint64_t known = driver_sequence(last_.sequence);
  const auto step = static_cast<int32_t>(sequence - static_cast<uint32_t>(known));
  return observe(rebasing_ ? sequence : known + static_cast<uint64_t>(int64_t{step}), time, now);
}

Vblank VblankCounter::observe(uint64_t driver_sequence, Nanoseconds time, Nanoseconds now) {
  if (rebasing_) {
    rebasing_ = false;
    offset_ = std::max(last_until(now).sequence, last_.sequence) - driver_sequence;
  }
  return accept(driver_sequence + offset_, time, now);
}

Vblank VblankCounter::accept(uint64_t sequence, Nanoseconds time, Nanoseconds now) {
  const bool backwards = static_cast<int64_t>(sequence - last_.sequence) < 0;
  if (backwards) sequence = last_.sequence;
  if (time < now - kMostInPast || time > now + kMostInFuture || time < last_.time)
    time = std::clamp(at(sequence).time, last_.time, std::max(now, last_.time));
  last_ = {sequence, time};
  anchor(last_);
  return last_;
}

Vblank VblankCounter::at(uint64_t sequence) const {
  if (sequence <= base_) return {sequence, timeline_.time_of(0)};
  return {sequence, timeline_.time_of(sequence - base_)};
}

Vblank VblankCounter::last_until(Nanoseconds time) const {
  return at(base_ + timeline_.sequence_at(time));
}

Vblank VblankCounter::first_from(Nanoseconds time) const {
  const Vblank before = last_until(time);
  return before.time >= time ? before : at(before.sequence + 1);
}

}  // namespace lenticule::display
