// SPDX-License-Identifier: Apache-2.0
// Watchdog decides whether to ping the systemd watchdog: yes if frames are displayed or none are
// due; no if flips fail, the display clock has stopped, or a due frame does not come.
#pragma once

#include <cstdint>
#include <string>

#include "player/playback/play_statistics.h"

namespace lenticule::player {

/// Monotonic counts of a running playback.
struct ProgressSample {
  uint64_t flips = 0;       ///< frames that were displayed
  uint64_t vblanks = 0;     ///< events of the display that the presenter handled
  uint64_t failures = 0;    ///< flips that were refused or never reported
  bool panel_away = false;  ///< switched off or unplugged: no frame would be visible
  bool stalled = false;     ///< a due frame does not come, for a reason in this process
};

/// Returns the stage of the playback that has not done what was due for two seconds; empty if none.
[[nodiscard]] inline std::string stalled_stage(const StageDelays& delays) {
  constexpr double kStalledS = 2.0;
  if (delays.presenter >= kStalledS) return "the presenter stands still";
  if (delays.display >= kStalledS) return "the display reports no vblank";
  if (delays.frame_copier >= kStalledS) return "the frame copier stands still";
  if (delays.source >= kStalledS) return "no frame arrives";
  return {};
}

/// Thread safety: one thread.
class Watchdog {
 public:
  /// Returns true if a frame was displayed since the last call, or if none was due: the source has
  /// no new frame, another session is in front, or the panel is away. Returns false if the
  /// display's flips keep failing, its clock stands still, or the playback is stalled.
  [[nodiscard]] bool should_ping(const ProgressSample& now) noexcept {
    const bool shown = now.flips != last_.flips;
    const bool idle =
        now.vblanks != last_.vblanks && now.failures == last_.failures && !now.stalled;
    last_ = now;
    return shown || idle || now.panel_away;
  }

 private:
  ProgressSample last_;
};

}  // namespace lenticule::player
