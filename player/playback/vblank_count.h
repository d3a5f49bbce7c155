// SPDX-License-Identifier: Apache-2.0
// VblankCount counts the vblanks of a playback, through returns of the display, whose own count
// then starts again.
#pragma once

#include <cstdint>

#include "display/display.h"

namespace lenticule::player {

/// Thread safety: one thread.
class VblankCount {
 public:
  explicit VblankCount(display::Nanoseconds period) : period_(period) {}

  /// Continues with a display that came back: the next event gives its count.
  void restart(display::Nanoseconds period) noexcept;
  /// Converts the vblank number of an event to that of the playback.
  [[nodiscard]] display::DisplayEvent in_our_count(display::DisplayEvent event) noexcept;
  /// Takes the vblank of an event in the playback's count.
  void observe(const display::DisplayEvent& event) noexcept;

  [[nodiscard]] display::Nanoseconds period() const noexcept { return period_; }
  /// Returns the last vblank that was observed, and its time; 0 before the first.
  [[nodiscard]] uint64_t last() const noexcept { return last_; }
  [[nodiscard]] display::Nanoseconds last_time() const noexcept { return last_time_; }
  /// Returns the time at which a vblank is expected.
  [[nodiscard]] display::Nanoseconds time_of(uint64_t vblank) const noexcept {
    return last_time_ + static_cast<int64_t>(vblank - last_) * period_;
  }
  /// Returns the first vblank after `time`, which may lie before the last event.
  [[nodiscard]] uint64_t first_after(display::Nanoseconds time) const noexcept;
  /// Returns the display's number for a vblank; 0 while that is not known.
  [[nodiscard]] uint64_t display_number(uint64_t vblank) const noexcept;

 private:
  display::Nanoseconds period_;
  uint64_t last_ = 0;
  display::Nanoseconds last_time_{0};
  uint64_t ahead_ = 0;  ///< the playback's number less the display's
  bool restarts_ = false;
};

}  // namespace lenticule::player
