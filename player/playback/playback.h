// SPDX-License-Identifier: Apache-2.0
// play() shows a source on a display: it starts, supervises and ends the threads.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "display/display.h"
#include "frames/frame_source.h"
#include "player/playback/playback_options.h"

namespace lenticule::player {

class FrameCopier;
class Presenter;

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

enum class PlayOutcome {
  Finished,       ///< the sequence or the requested time is over
  Stopped,        ///< the stop descriptor became readable
  SourceFailed,   ///< the last frame stays until the end of its time
  SourceStalled,  ///< no frame came for stall_timeout
  DisplayLost,
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
