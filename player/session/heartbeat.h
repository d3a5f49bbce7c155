// SPDX-License-Identifier: Apache-2.0
// Whether a playback deserves its watchdog's ping: not because some thread runs, but because
// pictures come onto the glass, or rightly do not.
#pragma once

#include <cstdint>

namespace lenticule::player {

/// Monotonic counts of a running playback.
struct Pulse {
  uint64_t flips = 0;       ///< pictures that reached the glass
  uint64_t vblanks = 0;     ///< events of the display that the presenter took
  uint64_t failures = 0;    ///< flips that were refused or never reported
  bool panel_away = false;  ///< switched off or unplugged: nobody could see a picture
};

/// One thread.
class Heartbeat {
 public:
  /// True if something was shown since the last call, or if there was nothing to show: the source
  /// has no new picture, another session is in front, the panel is away. A display whose flips fail
  /// again and again, or whose clock stands still, is not alive.
  [[nodiscard]] bool beats(const Pulse& now) noexcept {
    const bool shown = now.flips != last_.flips;
    const bool idle = now.vblanks != last_.vblanks && now.failures == last_.failures;
    last_ = now;
    return shown || idle || now.panel_away;
  }

 private:
  Pulse last_;
};

}  // namespace lenticule::player
