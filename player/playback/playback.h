// SPDX-License-Identifier: Apache-2.0
// Plays a source on a display: the threads, their beginning and their end.
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "display/display.h"
#include "frames/frame_source.h"
#include "player/playback/play_statistics.h"
#include "player/playback/presenter.h"

namespace lenticule::player {

/// A display that is lost, on the thread of play(); nobody else uses it or the source.
struct LostDisplay {
  const PlayReport& report;
  /// Until the vblanks that were asked for are over; none = no end.
  std::optional<std::chrono::nanoseconds> time_left;
  /// Keeps the source's peers content; to be called about every second.
  std::function<void()> serve_source;
};

enum class Comeback {
  Back,      ///< it works again, with frames of the same size: playing goes on
  GivenUp,   ///< the outcome is DisplayLost
  Stopped,   ///< the outcome is Stopped
  TimeOver,  ///< LostDisplay::time_left is over: the outcome is Finished
};

class Filler;

/// By which other threads steer a playback. It outlives the playbacks that it is given to; without
/// one that runs, pausing is remembered and everything else says that there is nothing.
class PlaybackControl {
 public:
  /// Any thread.
  void pause(bool paused);
  [[nodiscard]] bool paused() const;
  [[nodiscard]] GlassPlace on_glass() const;
  /// A copy of the frame on the glass, whose size is that of `into`; false where that cannot be
  /// had. Waits at most a second.
  [[nodiscard]] bool copy_shown(frames::WovenFrame& into);

  /// play(): what it steers from now on; nothing again before that ends.
  void attach(Presenter& presenter, Filler& filler, const PresenterStatistics& statistics);
  void detach();

 private:
  mutable std::mutex mutex_;
  bool paused_ = false;
  Presenter* presenter_ = nullptr;
  Filler* filler_ = nullptr;
  const PresenterStatistics* statistics_ = nullptr;
};

struct PlaybackOptions {
  /// How fast the content goes: the source's own rate if none, else the display's refresh.
  std::optional<frames::Rate> content = std::nullopt;
  LatePolicy late = LatePolicy::Slip;
  uint64_t loops = 1;  ///< or kForever
  uint64_t prime = 1;  ///< frames that must be ready before the first is shown
  std::optional<uint64_t> vblanks = std::nullopt;
  std::chrono::nanoseconds prime_timeout = std::chrono::seconds(2);
  std::optional<std::chrono::nanoseconds> stall_timeout = std::chrono::seconds(60);
  Filling filling = Filling::OwnThread;
  /// Ask the system for a real-time priority of the presenter; without permission it goes on.
  bool real_time_priority = false;

  /// May be null. Frames then stay lent until they have left the glass.
  PlaybackControl* control = nullptr;

  /// Readable = stop; -1 = never.
  int stop_fd = -1;
  /// Called about once a second on the thread of play(); what it throws ends the playback and
  /// leaves play().
  std::function<void(const PlayReport&)> on_report = nullptr;
  /// Brings a lost display back. The newest frame of the source is then shown again, and the
  /// sequence goes on from there. Null = a lost display ends the playback.
  std::function<Comeback(const LostDisplay&)> bring_back = nullptr;
  /// For PlayReport::first_frame_ms and its names.
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  std::string source_name = {};
};

struct PlayResult {
  PlayOutcome outcome = PlayOutcome::Finished;
  std::string failure;  ///< of the source, if it failed
  PlayReport report;
};

[[nodiscard]] const char* outcome_name(PlayOutcome outcome);

/// Blocks until it is over. Display and source are used by other threads meanwhile, and by none
/// afterwards. Throws Error(Input) when the source's frames are not the display's size.
[[nodiscard]] PlayResult play(display::Display& display, frames::FrameSource& source,
                              const PlaybackOptions& options);

}  // namespace lenticule::player
