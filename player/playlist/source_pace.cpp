// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/source_pace.h"

#include <fmt/format.h>
#include <poll.h>

#include "base/error.h"

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr auto kWarningPause = std::chrono::seconds(10);

double megabytes(frames::FrameGeometry geometry, double per_second) {
  return static_cast<double>(geometry.frame_bytes()) * per_second / 1e6;
}

void wait_for(frames::FrameSource& source) {
  pollfd entry{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
  (void)poll(&entry, 1, 20);
  source.service();
}

}  // namespace

nlohmann::ordered_json to_json(const PaceFigures& figures) {
  return {{"needed_frames_per_s", figures.needed_fps}, {"seen_frames_per_s", figures.seen_fps},
          {"needed_mb_per_s", figures.needed_mb_s},    {"seen_mb_per_s", figures.seen_mb_s},
          {"late_frames", figures.late_frames},        {"too_slow", figures.too_slow}};
}

std::string figures_text(const PaceFigures& figures) {
  return fmt::format("needs {:.1f} frames/s ({:.0f} MB/s), measured {:.1f} frames/s ({:.0f} MB/s)",
                     figures.needed_fps, figures.needed_mb_s, figures.seen_fps, figures.seen_mb_s);
}

PaceFigures SourcePace::look(const PlayReport& report, SteadyClock::time_point now) {
  const PaceCounts& pace = report.pace;
  const PaceCounts& before = before_.pace;
  const double seconds = looked_ ? std::chrono::duration<double>(now - *looked_).count() : 0.0;
  const bool late = pace.repeated_underrun > before.repeated_underrun;
  const bool steady = report.item == before_.item && report.content_rate == before_.content_rate &&
                      pace.held == before.held;
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

std::optional<std::string> SourcePace::warning(SteadyClock::time_point now) {
  if (!figures_.too_slow || (warned_ && now - *warned_ < kWarningPause)) return std::nullopt;
  warned_ = now;
  return fmt::format("too slow: {}; {} frames late so far", figures_text(figures_),
                     figures_.late_frames);
}

PaceFigures measure_source(frames::FrameSource& source, frames::Rate needed,
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
  PaceFigures figures{.needed_fps = needed.hertz()};
  // A source that fits the pool is decoded only once and never has to wait.
  const bool resident = frames == 0;
  figures.seen_fps = resident ? figures.needed_fps : static_cast<double>(frames) / seconds;
  figures.needed_mb_s = megabytes(source.geometry(), figures.needed_fps);
  figures.seen_mb_s = megabytes(source.geometry(), figures.seen_fps);
  figures.too_slow = figures.seen_fps < figures.needed_fps;
  return figures;
}

}  // namespace lenticule::player
