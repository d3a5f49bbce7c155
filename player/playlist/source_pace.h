// SPDX-License-Identifier: Apache-2.0
// Whether a source keeps up: frames and bytes that it should deliver a second, against what came.
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
  double seen_fps = 0.0;
  double needed_mb_s = 0.0;  ///< of pixels as they go to the glass, in 10^6 bytes
  double seen_mb_s = 0.0;
  uint64_t late_frames = 0;  ///< vblanks without the frame that was due, because it was not there
  bool too_slow = false;
};
[[nodiscard]] nlohmann::ordered_json to_json(const PaceFigures& figures);
/// "needs 60.0 frames/s (1493 MB/s), 41.2 frames/s (1025 MB/s) came"
[[nodiscard]] std::string figures_text(const PaceFigures& figures);

/// Looks at a playback's reports, about one a second. One thread.
class SourcePace {
 public:
  /// Over the time since the report before; too slow if frames were late in it, after the first
  /// second's.
  PaceFigures look(const PlayReport& report, std::chrono::steady_clock::time_point now);
  /// Of the last look; frames late are those of the whole playback.
  [[nodiscard]] const PaceFigures& figures() const { return figures_; }
  /// A sentence for people, at most every ten seconds, when it was too slow.
  [[nodiscard]] std::optional<std::string> warning(std::chrono::steady_clock::time_point now);

 private:
  std::optional<std::chrono::steady_clock::time_point> looked_;
  std::optional<std::chrono::steady_clock::time_point> warned_;
  PaceCounts before_{};
  PaceFigures figures_;
};

/// Takes frames from a source as fast as they come, for `longest` at most or to the end of a round,
/// and says whether that is `needed` or more. Without the pool's first frames, which were decoded
/// before anybody waited. Throws Error(Input) for a source that breaks or holds no frame.
[[nodiscard]] PaceFigures measure_source(frames::FrameSource& source, frames::Rate needed,
                                         std::chrono::milliseconds longest);

}  // namespace lenticule::player
