// SPDX-License-Identifier: Apache-2.0
// Watchdog decides whether to ping the systemd watchdog: yes if frames are displayed or none are
// due; no if flips fail or the display clock has stopped.
#pragma once

#include <cstdint>

namespace lenticule::player {

/// Monotonic counts of a running playback.
struct ProgressSample {
  uint64_t flips = 0;       ///< frames that were displayed
  uint64_t vblanks = 0;     ///< events of the display that the presenter handled
  uint64_t failures = 0;    ///< flips that were refused or never reported
  bool panel_away = false;  ///< switched off or unplugged: no frame would be visible
};

/// Thread safety: one thread.
class Watchdog {
 public:
  /// Returns true if a frame was displayed since the last call, or if none was due: the source has
  /// no new frame, another session is in front, or the panel is away. Returns false if the
  /// display's flips keep failing or its clock stands still.
  [[nodiscard]] bool should_ping(const ProgressSample& now) noexcept {
    const bool shown = now.flips != last_.flips;
    const bool idle = now.vblanks != last_.vblanks && now.failures == last_.failures;
    last_ = now;
    return shown || idle || now.panel_away;
  }

 private:
  ProgressSample last_;
};

}  // namespace lenticule::player
