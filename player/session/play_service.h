// SPDX-License-Identifier: Apache-2.0
// A playback as a service: ready with the first picture, a status line for people, a watchdog that
// is pinged only while pictures come, and the lit panel kept for the next player.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>

#include "display/kms/scanout/kms_display.h"
#include "player/playback/play_statistics.h"
#include "player/session/heartbeat.h"
#include "player/session/service_manager.h"

namespace lenticule::player {

[[nodiscard]] Pulse pulse_of(const PlayReport& report, const display::KmsStatistics* kms);

/// "EXACT yes; 600 frames shown, 0 underruns, 0 missed vblanks, panel showing; DP-1 on ..."
[[nodiscard]] std::string status_text(const PlayReport& report, const display::KmsStatistics* kms,
                                      const display::ExactnessReport* exactness);

/// One thread. Does nothing where there is no service manager.
class PlayService {
 public:
  /// `display` is null unless it is a KMS display; it must live as long as reports come.
  PlayService(const ServiceManager& manager, const display::KmsDisplay* display);

  /// About once a second while it plays.
  void report(const PlayReport& report);
  /// The display came back: the manager is given what it is now.
  void keep_again();
  /// What is wrong although something is shown, for the status line; empty = nothing.
  void set_trouble(const std::string& trouble) { trouble_ = trouble; }
  /// What is wrong beside the picture, for the end of the status line; empty = nothing.
  void set_warning(const std::string& warning) { warning_ = warning; }

 private:
  const ServiceManager& manager_;
  const display::KmsDisplay* display_;
  Heartbeat heartbeat_;
  bool ready_ = false;
  std::string trouble_;
  std::string warning_;
  std::chrono::steady_clock::time_point last_beat_;
};

}  // namespace lenticule::player
