// SPDX-License-Identifier: Apache-2.0
// SourcePace checks whether a source keeps up: required against delivered frames and bytes per
// second.
#pragma once

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "frames/frame_source.h"
#include "player/playback/play_statistics.h"

namespace lenticule::player {

struct PaceFigures {
  double needed_fps = 0.0;
  double seen_fps = 0.0;     ///< 0: not measured yet since the item, its rate or the speed changed
  double needed_mb_s = 0.0;  ///< 10^6 bytes of displayed pixels per second
  double seen_mb_s = 0.0;
  uint64_t late_frames = 0;  ///< vblanks at which the due frame was not available
  bool too_slow = false;
};
[[nodiscard]] nlohmann::ordered_json to_json(const PaceFigures& figures);
/// Returns "needs 60.0 frames/s (1493 MB/s), 41.2 frames/s (1025 MB/s) came".
[[nodiscard]] std::string figures_text(const PaceFigures& figures);

/// SourcePace evaluates a playback's reports, about one per second. Thread safety: one thread.
class SourcePace {
 public:
  /// Evaluates the time since the previous report. The source is too slow if frames were late in
  /// that time and fewer came than needed, not counting the first second of the playback, a pause,
  /// or a time in which the item, its rate or the speed changed.
  PaceFigures look(const PlayReport& report, std::chrono::steady_clock::time_point now);
  /// Returns the last evaluation; its late frames are those of the whole playback.
  [[nodiscard]] const PaceFigures& figures() const { return figures_; }
  /// Returns a sentence for people when the source was too slow, at most every ten seconds.
  [[nodiscard]] std::optional<std::string> warning(std::chrono::steady_clock::time_point now);

 private:
  std::optional<std::chrono::steady_clock::time_point> looked_;
  std::optional<std::chrono::steady_clock::time_point> warned_;
  PlayReport before_;
  PaceFigures figures_;
};

/// Pulls frames from a source as fast as possible, until `longest` has passed or a round is
/// complete, and compares the rate with `needed`. The pool's first frames are not counted, because
/// they are decoded before the measurement starts. Throws Error(Input) for a source that fails or
/// has no frame.
[[nodiscard]] PaceFigures measure_source(frames::FrameSource& source, frames::Rate needed,
                                         std::chrono::milliseconds longest);

}  // namespace lenticule::player
