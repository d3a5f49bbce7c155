// SPDX-License-Identifier: Apache-2.0
// PlayService reports a playback to systemd: ready with the first frame, a status line for people,
// watchdog pings only while frames are displayed, and the active output kept for the next player.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>

#include "display/kms/scanout/kms_display.h"
#include "player/playback/play_statistics.h"
#include "player/session/service_manager.h"
#include "player/session/watchdog.h"

namespace lenticule::player {

[[nodiscard]] ProgressSample progress_sample(const PlayReport& report,
                                             const display::KmsStatistics* kms);

/// Returns "EXACT yes; 600 frames shown, 0 underruns, 0 missed vblanks, panel showing; DP-1 on
/// ...".
[[nodiscard]] std::string status_text(const PlayReport& report, const display::KmsStatistics* kms,
                                      const display::ExactnessReport* exactness);

/// Does nothing if there is no service manager. Thread safety: one thread.
class PlayService {
 public:
  /// `display` is null unless it is a KMS display. Lifetime: it must stay valid until the last
  /// report.
  PlayService(const ServiceManager& manager, const display::KmsDisplay* display);

  /// Call about once a second while playing.
  void report(const PlayReport& report);
  /// Stores the output again after the display came back.
  void store_again();
  /// Sets an error that replaces normal playback, for the status line; empty = none.
  void set_problem(const std::string& problem) { problem_ = problem; }
  /// Sets a warning that does not affect the picture, for the end of the status line; empty = none.
  void set_warning(const std::string& warning) { warning_ = warning; }

 private:
  const ServiceManager& manager_;
  const display::KmsDisplay* display_;
  Watchdog watchdog_;
  bool ready_ = false;
  std::string problem_;
  std::string warning_;
  std::chrono::steady_clock::time_point last_ping_;
};

}  // namespace lenticule::player
