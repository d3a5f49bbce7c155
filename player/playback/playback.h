// SPDX-License-Identifier: Apache-2.0
// play() shows a source on a display: it starts, supervises and ends the threads.
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

/// The state passed to PlaybackOptions::reconnect. Used on the thread of play(); no other
/// thread uses the display or the source meanwhile.
struct LostDisplay {
  const PlayReport& report;
  /// Time until the requested vblanks are over; none = no end.
  std::optional<std::chrono::nanoseconds> time_left;
  /// Keeps the source's peers connected; call it about every second.
  std::function<void()> serve_source;
};

enum class ReconnectResult {
  Reconnected,  ///< the display works again with frames of the same size: playing continues
  GivenUp,      ///< the outcome is DisplayLost
  Stopped,      ///< the outcome is Stopped
  TimeOver,     ///< LostDisplay::time_left is over: the outcome is Finished
};

class FrameCopier;

/// PlaybackControl lets other threads control a playback. While no playback is attached, pausing is
/// remembered and everything else reports that nothing is displayed. Lifetime: must outlive the
/// playbacks that use it.
class PlaybackControl {
 public:
  /// Thread safety: any thread.
  void pause(bool paused);
  [[nodiscard]] bool paused() const;
  /// Switches the output off or on. Returns true once that is done, false if it is not done within
  /// `timeout`; it is then done as soon as possible.
  [[nodiscard]] bool switch_output(bool on, std::chrono::milliseconds timeout);
  /// Returns true while the output is switched off.
  [[nodiscard]] bool is_off() const;
  /// Sets the thousandths of its rate at which content is played.
  void set_speed(uint32_t permille);
  [[nodiscard]] uint32_t speed_permille() const;
  /// See Presenter. time_next_cut() also returns true while no playback is attached.
  [[nodiscard]] bool time_next_cut();
  void forget_next_cut();
  [[nodiscard]] DisplayedPlace displayed() const;
  [[nodiscard]] LeftItem left_item(uint64_t item) const;
  /// Copies the displayed frame, which must have the size of `into`, or one panel's part of it;
  /// returns false if that is not possible. Waits at most a second, in which only attach() and
  /// detach() wait for it.
  [[nodiscard]] bool copy_shown(frames::WovenFrame& into, size_t part = 0);

  /// Called by play(): attaches the running playback, and detaches it before play() returns.
  void attach(Presenter& presenter, FrameCopier& frame_copier,
              const PresenterStatistics& statistics);
  void detach();

 private:
  std::mutex copy_mutex_;  ///< guards frame_copier_; locked first, for as long as a frame is copied
  FrameCopier* frame_copier_ = nullptr;
  mutable std::mutex mutex_;  ///< guards the members below, for a few instructions at a time
  bool paused_ = false;
  bool off_ = false;
  uint32_t speed_permille_ = 1000;
  Presenter* presenter_ = nullptr;
  const PresenterStatistics* statistics_ = nullptr;
};

struct PlaybackOptions {
  /// Content rate; none = the source's own rate, else the display's refresh.
  std::optional<frames::Rate> content = std::nullopt;
  LatePolicy late = LatePolicy::Slip;
  uint64_t loops = 1;  ///< or kForever
  uint64_t prime = 1;  ///< frames that must be ready before the first is shown
  std::optional<uint64_t> vblanks = std::nullopt;
  std::chrono::nanoseconds prime_timeout = std::chrono::seconds(2);
  std::optional<std::chrono::nanoseconds> stall_timeout = std::chrono::seconds(60);
  Filling filling = Filling::OwnThread;
  /// Requests real-time priority for the presenter; continues without it if not permitted.
  bool real_time_priority = false;

  /// May be null. If set, frames stay acquired until they are no longer displayed.
  PlaybackControl* control = nullptr;
  /// PresenterOptions::step.
  StepPacing* step = nullptr;
  /// PresenterOptions::turns.
  TurnLog* turns = nullptr;
  /// Called on the thread of play() when a turn has begun or ended, except the last end.
  std::function<void()> on_turn = nullptr;

  /// Readable = stop; -1 = never.
  int stop_fd = -1;
  /// Called about once a second on the thread of play(); an exception from it ends the playback and
  /// leaves play().
  std::function<void(const PlayReport&)> on_report = nullptr;
  /// Reconnects a lost display. The source's newest frame is then shown again and the sequence
  /// continues from there. Null = a lost display ends the playback.
  std::function<ReconnectResult(const LostDisplay&)> reconnect = nullptr;
  /// Reference time of PlayReport::first_frame_ms, and the source's name in the report.
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  std::string source_name = {};
};

struct PlayResult {
  PlayOutcome outcome = PlayOutcome::Finished;
  std::string failure;  ///< the source's error if it failed
  PlayReport report;
};

[[nodiscard]] const char* outcome_name(PlayOutcome outcome);

/// Plays to the end and returns the result. Other threads use the display and the source meanwhile,
/// none afterwards. Throws Error(Input) if the source's frames do not have the display's size.
[[nodiscard]] PlayResult play(display::Display& display, frames::FrameSource& source,
                              const PlaybackOptions& options);

}  // namespace lenticule::player
