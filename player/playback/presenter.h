// SPDX-License-Identifier: Apache-2.0
// Presenter shows the right frame at every vblank: it takes filled buffers, submits them when the
// pacer says so, and records the vblank numbers that the display reports. The loop neither throws
// nor allocates.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

#include "base/unique_fd.h"
#include "display/display.h"
#include "player/playback/frame_copier.h"

namespace lenticule::player {

/// VblankCount counts the vblanks of a playback, through returns of the display, whose own count
/// then starts again.
/// Thread safety: one thread.
class VblankCount {
 public:
  explicit VblankCount(display::Nanoseconds period) : period_(period) {}

  /// Continues with a display that came back: the next event gives its count.
  void restart(display::Nanoseconds period) noexcept;
  /// Converts the vblank number of an event to that of the playback.
  [[nodiscard]] display::DisplayEvent in_our_count(display::DisplayEvent event) noexcept;
  /// Takes the vblank of an event in the playback's count.
  void observe(const display::DisplayEvent& event) noexcept;

  [[nodiscard]] display::Nanoseconds period() const noexcept { return period_; }
  /// Returns the last vblank that was observed, and its time; 0 before the first.
  [[nodiscard]] uint64_t last() const noexcept { return last_; }
  [[nodiscard]] display::Nanoseconds last_time() const noexcept { return last_time_; }
  /// Returns the time at which a vblank is expected.
  [[nodiscard]] display::Nanoseconds time_of(uint64_t vblank) const noexcept {
    return last_time_ + static_cast<int64_t>(vblank - last_) * period_;
  }
  /// Returns the first vblank after `time`, which may lie before the last event.
  [[nodiscard]] uint64_t first_after(display::Nanoseconds time) const noexcept;
  /// Returns the display's number for a vblank; 0 while that is not known.
  [[nodiscard]] uint64_t display_number(uint64_t vblank) const noexcept;

 private:
  display::Nanoseconds period_;
  uint64_t last_ = 0;
  display::Nanoseconds last_time_{0};
  uint64_t ahead_ = 0;  ///< the playback's number less the display's
  bool restarts_ = false;
};

enum class PlayOutcome {
  Finished,       ///< the sequence or the requested time is over
  Stopped,        ///< request_stop()
  SourceFailed,   ///< the last frame stays until the end of its time
  SourceStalled,  ///< no frame came for stall_timeout
  DisplayLost,
};

/// Thread safety: the presenter's thread, except where noted.
class Presenter {
 public:
  /// Lifetime: all arguments must outlive the presenter.
  Presenter(display::Display& display, FrameCopier& frame_copier, PresenterStatistics& statistics,
            const PlaybackOptions& options);

  /// Runs the playback. Returns DisplayLost as soon as the display reports that state.
  [[nodiscard]] PlayOutcome run() noexcept;
  /// Prepares another run() after DisplayLost, once the display is back; it shows `frame` first.
  /// The vblank count is advanced by the elapsed time.
  void resume(uint64_t frame) noexcept;
  /// Returns the time until the requested vblanks are over; none = no end.
  [[nodiscard]] std::optional<display::Nanoseconds> time_left() const noexcept;
  /// Counts the last frame's vblanks. Call it once after the last run().
  void finish_statistics() noexcept;
  /// Any thread: completes the pending flip and ends run().
  void request_stop() noexcept;
  /// Any thread: keeps the displayed frame, except that one frame is shown after every
  /// discontinuity of the source.
  void set_paused(bool paused) noexcept;
  /// Any thread: switches the output off between two flips, once the first frame has been shown, or
  /// on again. The vblanks in between count as held.
  void set_off(bool off) noexcept;
  /// Any thread: requests that the first frame after the next discontinuity of the source is shown
  /// at the second vblank from now, or as soon as it is ready after that. Returns false while an
  /// earlier request is not fulfilled.
  [[nodiscard]] bool time_next_cut() noexcept;
  /// Any thread: withdraws that request.
  void forget_next_cut() noexcept { cut_asked_at_.store(0, std::memory_order_release); }
  /// Any thread: plays the content at this many thousandths of its rate, from the next frame on.
  void set_speed(uint32_t permille) noexcept;

 private:
  struct PendingFlip {
    uint64_t target = 0;
    uint64_t id = 0;
    display::Nanoseconds submitted{0};
    uint64_t number = 0;
    uint32_t item = 0;
    uint64_t cut = 0;
    bool timed = false;  ///< fulfils time_next_cut()
  };

  void play_on() noexcept;
  void prime() noexcept;
  [[nodiscard]] frames::Rate content_wanted() const noexcept;
  void choose_rate() noexcept;
  void state_rate() noexcept;
  void act() noexcept;
  void submit(const FilledFrame& frame, uint64_t target) noexcept;
  void starve(uint64_t target) noexcept;
  void end_at_vblank(uint64_t vblank, PlayOutcome outcome) noexcept;
  void discard_before(uint64_t index) noexcept;
  void discard_head() noexcept;
  void follow_cut() noexcept;
  void follow_rate() noexcept;
  void follow_group() noexcept;
  [[nodiscard]] bool holds_still() noexcept;
  [[nodiscard]] bool is_off() noexcept;
  [[nodiscard]] bool head_is_ready() const noexcept;
  void request_vblank(uint64_t sequence) noexcept;

  void handle(const display::DisplayEvent& event) noexcept;
  void handle_flip(const display::DisplayEvent& event) noexcept;
  void handle_timeout() noexcept;
  void end_flip() noexcept;
  void observe_vblank(const display::DisplayEvent& event) noexcept;
  void land_pending_flip() noexcept;

  [[nodiscard]] uint64_t next_reachable_vblank() const noexcept;
  [[nodiscard]] display::Nanoseconds awaited_by() const noexcept;
  [[nodiscard]] display::Nanoseconds event_timeout() const noexcept;
  [[nodiscard]] bool over() const noexcept {
    return outcome_.has_value() || stopping_.load(std::memory_order_acquire);
  }
  void publish() noexcept;

  display::Display& display_;
  FrameCopier& frame_copier_;
  PresenterStatistics& statistics_;
  const PlaybackOptions& options_;
  VblankCount vblanks_;
  Pacer pacer_;
  uint64_t first_frame_ = 0;  ///< not 0 if the display was lost before it showed a frame

  std::optional<PlayOutcome> outcome_;
  std::optional<uint64_t> end_vblank_;  ///< vblank at which playing ends
  PlayOutcome outcome_at_end_ = PlayOutcome::Finished;
  std::optional<PendingFlip> pending_;
  bool tick_requested_ = false;
  uint64_t tick_after_ = 0;                ///< vblank after which the requested tick is due
  display::Nanoseconds tick_expected_{0};  ///< time at which that tick is expected
  bool rebuffering_ = false;               ///< LatePolicy::Hold after an underrun
  std::optional<display::Nanoseconds> starved_since_;
  std::optional<display::Nanoseconds> silent_since_;  ///< first timeout since the last event
  frames::Rate wanted_rate_;  ///< rate of the next frame, before it is locked to the display
  uint64_t cut_ = 0;          ///< the source's discontinuity number that was handled last
  bool after_cut_ = false;    ///< waiting for the first frame after a discontinuity
  std::optional<uint64_t> timed_cut_;  ///< first vblank that may show the frame after a timed cut
  bool shows_one_more_ = true;         ///< shows one more frame although paused
  bool off_ = false;                   ///< the output is switched off
  int events_lost_in_a_row_ = 0;
  int refused_in_a_row_ = 0;

  WakeFd wake_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> paused_{false};
  std::atomic<bool> off_wanted_{false};
  std::atomic<uint32_t> speed_permille_{1000};
  std::atomic<int64_t> cut_asked_at_{0};  ///< display time of time_next_cut(); 0: none
};

}  // namespace lenticule::player
