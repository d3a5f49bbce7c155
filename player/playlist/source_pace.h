// SPDX-License-Identifier: Apache-2.0
// SourcePace checks whether a source keeps up: required against delivered frames and bytes per
// second.
#pragma once

#include <fmt/format.h>
#include <poll.h>

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/error.h"
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
[[nodiscard]] inline nlohmann::ordered_json to_json(const PaceFigures& figures) {
  return {{"needed_frames_per_s", figures.needed_fps}, {"seen_frames_per_s", figures.seen_fps},
          {"needed_mb_per_s", figures.needed_mb_s},    {"seen_mb_per_s", figures.seen_mb_s},
          {"late_frames", figures.late_frames},        {"too_slow", figures.too_slow}};
}
/// Returns "needs 60.0 frames/s (1493 MB/s), 41.2 frames/s (1025 MB/s) came".
[[nodiscard]] inline std::string figures_text(const PaceFigures& figures) {
  return fmt::format("needs {:.1f} frames/s ({:.0f} MB/s), measured {:.1f} frames/s ({:.0f} MB/s)",
                     figures.needed_fps, figures.needed_mb_s, figures.seen_fps, figures.seen_mb_s);
}

/// SourcePace evaluates a playback's reports, about one per second. Thread safety: one thread.
class SourcePace {
 public:
  using SteadyClock = std::chrono::steady_clock;

  /// Evaluates the time since the previous report. The source is too slow if frames were late in
  /// that time and fewer came than needed, not counting the first second of the playback, a pause,
  /// or a time in which the item, its rate or the speed changed.
  PaceFigures look(const PlayReport& report, SteadyClock::time_point now) {
    const PaceCounts& pace = report.pace;
    const PaceCounts& before = before_.pace;
    const double seconds = looked_ ? std::chrono::duration<double>(now - *looked_).count() : 0.0;
    const bool late = pace.repeated_underrun > before.repeated_underrun;
    const bool steady = report.item == before_.item &&
                        report.content_rate == before_.content_rate && pace.held == before.held;
    figures_.needed_fps = report.content_rate.hertz();
    figures_.late_frames = pace.repeated_underrun;
    const auto taken = [](const PaceCounts& counts) {
      return static_cast<double>(counts.shown + counts.dropped + counts.skipped_planned);
    };
    figures_.seen_fps = steady && seconds > 0.0 ? (taken(pace) - taken(before)) / seconds : 0.0;
    figures_.too_slow = steady && seconds > 0.0 && late && pace.underruns_after_start > 0 &&
                        figures_.seen_fps < figures_.needed_fps;
    figures_.needed_mb_s = megabytes(report.geometry, figures_.needed_fps);
    figures_.seen_mb_s = megabytes(report.geometry, figures_.seen_fps);
    looked_ = now;
    before_ = report;
    return figures_;
  }
  /// Returns the last evaluation; its late frames are those of the whole playback.
  [[nodiscard]] const PaceFigures& figures() const { return figures_; }
  /// Returns a sentence for people when the source was too slow, at most every ten seconds.
  [[nodiscard]] std::optional<std::string> warning(SteadyClock::time_point now) {
    if (!figures_.too_slow || (warned_ && now - *warned_ < kWarningPause)) return std::nullopt;
    warned_ = now;
    return fmt::format("too slow: {}; {} frames late so far", figures_text(figures_),
                       figures_.late_frames);
  }
  /// Pulls frames from a source as fast as possible, until `longest` has passed or a round is
  /// complete, and compares the rate with `needed`. The pool's first frames are not counted,
  /// because they are decoded before the measurement starts. Throws Error(Input) for a source that
  /// fails or has no frame.
  [[nodiscard]] static PaceFigures measure(frames::FrameSource& source, frames::Rate needed,
                                           std::chrono::milliseconds longest) {
    const auto deadline = SteadyClock::now() + longest;
    std::optional<SteadyClock::time_point> begin;
    uint64_t frames = 0;
    uint64_t ahead = 0;
    uint64_t pulled = 0;
    frames::AcquiredFrame acquired;
    while (SteadyClock::now() < deadline) {
      const frames::PullStatus status = source.pull(acquired);
      if (status == frames::PullStatus::End) break;
      if (status == frames::PullStatus::Failed)
        throw Error(ErrorKind::Input, source.failure(),
                    "the frame after the last good one is broken");
      if (status == frames::PullStatus::NotYet) {
        wait_for(source);
        continue;
      }
      source.release(acquired.token);
      ++pulled;
      if (!begin) {
        begin = SteadyClock::now();
        ahead = source.ready_count();
      } else if (pulled > ahead + 1) {
        ++frames;
      }
    }
    if (pulled == 0)
      throw Error(ErrorKind::Input, "the source contains no frame, or none arrived in time");
    const double seconds = std::chrono::duration<double>(SteadyClock::now() - *begin).count();
    // A source that fits the pool is decoded only once and never has to wait.
    const bool resident = frames == 0;
    return compare(needed, resident ? needed.hertz() : static_cast<double>(frames) / seconds,
                   source.geometry());
  }
  [[nodiscard]] static PaceFigures compare(frames::Rate needed, double seen_fps,
                                           frames::FrameGeometry geometry) {
    return {.needed_fps = needed.hertz(),
            .seen_fps = seen_fps,
            .needed_mb_s = megabytes(geometry, needed.hertz()),
            .seen_mb_s = megabytes(geometry, seen_fps),
            .too_slow = seen_fps < needed.hertz()};
  }

 private:
  static constexpr auto kWarningPause = std::chrono::seconds(10);

  static double megabytes(frames::FrameGeometry geometry, double per_second) {
    return static_cast<double>(geometry.frame_bytes()) * per_second / 1e6;
  }

  static void wait_for(frames::FrameSource& source) {
    pollfd entry{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
    (void)poll(&entry, 1, 20);
    source.service();
  }
  std::optional<std::chrono::steady_clock::time_point> looked_;
  std::optional<std::chrono::steady_clock::time_point> warned_;
  PlayReport before_;
  PaceFigures figures_;
};

}  // namespace lenticule::player
