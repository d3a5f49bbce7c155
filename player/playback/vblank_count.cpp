// SPDX-License-Identifier: Apache-2.0
#include "player/playback/vblank_count.h"

#include <algorithm>
#include <utility>

namespace lenticule::player {
namespace {

using display::Nanoseconds;

}  // namespace

void VblankCount::restart(Nanoseconds period) noexcept {
  period_ = period;
  restarts_ = true;
}

/// The first event after the display came back gives the new offset; the elapsed time gives the
/// playback's number.
display::DisplayEvent VblankCount::in_our_count(display::DisplayEvent event) noexcept {
  if (std::exchange(restarts_, false) && last_time_ > Nanoseconds{0}) {
    const int64_t away = std::max<int64_t>(1, (event.time - last_time_) / period_);
    ahead_ = last_ + static_cast<uint64_t>(away) - event.sequence;
  }
  event.sequence += ahead_;
  return event;
}

void VblankCount::observe(const display::DisplayEvent& event) noexcept {
  last_ = std::max(last_, event.sequence);
  last_time_ = std::max(last_time_, event.time);
}

uint64_t VblankCount::first_after(Nanoseconds time) const noexcept {
  const Nanoseconds since = time - last_time_;
  if (since >= Nanoseconds{0}) return last_ + 1 + static_cast<uint64_t>(since / period_);
  return last_ - std::min(last_, static_cast<uint64_t>(-since / period_));
}

uint64_t VblankCount::display_number(uint64_t vblank) const noexcept {
  const auto theirs = static_cast<int64_t>(vblank - ahead_);
  return !restarts_ && theirs > 0 ? static_cast<uint64_t>(theirs) : 0;
}

}  // namespace lenticule::player
