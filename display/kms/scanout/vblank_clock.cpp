// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/vblank_clock.h"

#include <algorithm>

namespace lenticule::display {
namespace {

/// A driver's timestamp may be that of the next active picture, or be reported late. A timestamp
/// beyond these limits is not a time.
constexpr Nanoseconds kMostInFuture = std::chrono::milliseconds(50);
constexpr Nanoseconds kMostInPast = std::chrono::seconds(1);

constexpr int kSameSequencesBeforeSoftware = 2;
constexpr Nanoseconds kTickTimeout = std::chrono::milliseconds(200);

}  // namespace

// --- VblankCounter --------------------------------------------------------------------------

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

Vblank VblankCounter::first_from(Nanoseconds time) const {
  const Vblank before = last_until(time);
  return before.time >= time ? before : at(before.sequence + 1);
}

// --- VblankClock ----------------------------------------------------------------------------

Nanoseconds flip_timeout(Nanoseconds period) noexcept {
  return std::max<Nanoseconds>(4 * period, std::chrono::milliseconds(200));
}

namespace {

VblankCounter first_count(const KmsOutput& output, frames::Rate refresh, Nanoseconds now) {
  using enum VblankCounter::Source;
  uint64_t sequence = 0;
  Nanoseconds time{0};
  if (output.read_sequence(sequence, time) != 0) return {Software, refresh, {0, now}};
  const bool plausible = time > Nanoseconds{0} && time <= now;
  return {Hardware, refresh, {sequence, plausible ? time : now}};
}

}  // namespace

VblankClock::VblankClock(const KmsOutput& output, frames::Rate refresh, Clock& clock,
                         KmsCounters& counters)
    : output_(output),
      clock_(clock),
      counters_(counters),
      counter_(first_count(output, refresh, clock.now())),
      last_flip_sequence_(counter_.last().sequence) {
  counters_.hardware_clock = is_hardware();
}

VblankClock::Landing VblankClock::place(const DrmEvent& flip) noexcept {
  watch_sequences(flip.sequence);
  const Nanoseconds now = clock_.now();
  if (is_hardware())
    return place_at(
        counter_.observe_low_bits(static_cast<uint32_t>(flip.sequence), flip.time, now));
  const bool plausible = flip.time > now - flip_timeout(period()) && flip.time <= now;
  return place_at(counter_.first_from(plausible ? flip.time : now));
}

VblankClock::Landing VblankClock::place_at(Vblank vblank) noexcept {
  const uint64_t earliest = last_flip_sequence_ + 1;
  if (vblank.sequence < earliest)
    vblank = is_hardware() ? Vblank{earliest, vblank.time} : counter_.at(earliest);
  last_flip_sequence_ = vblank.sequence;
  return {.vblank = vblank, .report_at = is_hardware() ? clock_.now() : vblank.time};
}

/// Detects drivers that do not count: two flips cannot happen in the same vblank.
void VblankClock::watch_sequences(uint64_t sequence) noexcept {
  same_sequences_ = sequence == last_driver_sequence_ ? same_sequences_ + 1 : 0;
  last_driver_sequence_ = sequence;
  if (same_sequences_ < kSameSequencesBeforeSoftware || !is_hardware()) return;
  counter_.use_software(clock_.now());
  counters_.hardware_clock = false;
}

void VblankClock::request(uint64_t sequence, uint64_t serial, bool may_ask_driver) noexcept {
  const Nanoseconds now = clock_.now();
  const uint64_t target = std::max(sequence + 1, counter_.last_until(now).sequence);
  if (tick_.phase == Tick::Phase::Awaited && tick_.sequence == target) return;  // already requested
  tick_ = {.phase = Tick::Phase::Timed,
           .sequence = target,
           .serial = serial,
           .due = counter_.at(target).time,
           .vblank = {}};
  if (!is_hardware() || !may_ask_driver) return;
  if (output_.queue_sequence(counter_.driver_sequence(target), serial) != 0) return;
  tick_.phase = Tick::Phase::Awaited;
  tick_.due = std::max(tick_.due, now) + kTickTimeout;
}

bool VblankClock::observe(const DrmEvent& tick) noexcept {
  if (tick_.phase != Tick::Phase::Awaited || tick.id != tick_.serial) return false;
  tick_.vblank = counter_.observe(tick.sequence, tick.time, clock_.now());
  tick_.phase = Tick::Phase::Ready;
  return true;
}

Nanoseconds VblankClock::due() const noexcept {
  const bool waiting = tick_.phase == Tick::Phase::Awaited || tick_.phase == Tick::Phase::Timed;
  return waiting ? tick_.due : kNever;
}

void VblankClock::run_timers() noexcept {
  const Nanoseconds now = clock_.now();
  if (now < due()) return;
  if (tick_.phase == Tick::Phase::Awaited) {
    ++counters_.lost_ticks;
    tick_.vblank = counter_.last_until(now);
  } else {
    tick_.vblank = counter_.at(tick_.sequence);
  }
  tick_.phase = Tick::Phase::Ready;
}

std::optional<Vblank> VblankClock::take_tick() noexcept {
  if (tick_.phase != Tick::Phase::Ready) return std::nullopt;
  tick_.phase = Tick::Phase::None;
  return tick_.vblank;
}

}  // namespace lenticule::display
