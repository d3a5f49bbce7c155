// SPDX-License-Identifier: Apache-2.0
// The loop that shows the right frame at every vblank: takes filled buffers, submits them when the
// pacer says so, and takes the display's events for facts. Neither throws nor allocates.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

#include "base/wake_fd.h"
#include "display/display.h"
#include "player/playback/filler.h"
#include "player/playback/pacing.h"
#include "player/playback/play_statistics.h"

namespace lenticule::player {

enum class Filling {
  OwnThread,    ///< Filler::run() goes on elsewhere
  InPresenter,  ///< the presenter fills between vblanks: for simulated time, where nobody else has
                ///< any
};

enum class PlayOutcome {
  Finished,       ///< to the end, or as long as asked for
  Stopped,        ///< request_stop()
  SourceFailed,   ///< the last frame stays to the end of its time
  SourceStalled,  ///< no frame came for stall_timeout
  DisplayLost,
};

struct PresenterOptions {
  /// How fast the content goes: the source's own rate if none, else the display's refresh.
  std::optional<frames::Rate> content = std::nullopt;
  LatePolicy late = LatePolicy::Slip;
  /// Vblanks to play, counted from the first flip; none = to the end.
  std::optional<uint64_t> vblanks = std::nullopt;
  /// How long to wait for a full priming once the first frame is there.
  display::Nanoseconds prime_timeout = std::chrono::seconds(2);
  /// How long to wait for the next frame when none is there; none = for ever.
  std::optional<display::Nanoseconds> stall_timeout = std::chrono::seconds(60);
  Filling filling = Filling::OwnThread;
};

/// Everything but request_stop() on the presenter's thread.
class Presenter {
 public:
  Presenter(display::Display& display, Filler& filler, PresenterStatistics& statistics,
            const PresenterOptions& options);

  /// Ends with DisplayLost as soon as the display says so.
  [[nodiscard]] PlayOutcome run() noexcept;
  /// After DisplayLost, once the display is back: run() may be called again, and shows `frame`
  /// first. Vblanks went on by time meanwhile, without a picture.
  void resume(uint64_t frame) noexcept;
  /// Until the vblanks that were asked for are over; none = no end.
  [[nodiscard]] std::optional<display::Nanoseconds> time_left() const noexcept;
  /// After the last run(): accounts for the last frame's stay. Once.
  void close_books() noexcept;
  /// Any thread: finish the pending flip and return.
  void request_stop() noexcept;
  /// Any thread: what is on the glass stays there, but for one frame after every cut of the source.
  void set_paused(bool paused) noexcept;

 private:
  struct PendingFlip {
    uint64_t target = 0;
    uint64_t id = 0;
    display::Nanoseconds submitted{0};
    uint64_t number = 0;
    uint32_t item = 0;
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
  [[nodiscard]] bool holds_still() noexcept;
  [[nodiscard]] bool head_is_ready() const noexcept;
  void request_vblank(uint64_t sequence) noexcept;

  void handle(const display::DisplayEvent& event) noexcept;
  void handle_flip(const display::DisplayEvent& event) noexcept;
  void handle_timeout() noexcept;
  void observe_vblank(const display::DisplayEvent& event) noexcept;
  void land_pending_flip() noexcept;

  [[nodiscard]] display::DisplayEvent in_our_count(display::DisplayEvent event) noexcept;
  [[nodiscard]] uint64_t next_reachable_vblank() const noexcept;
  [[nodiscard]] display::Nanoseconds awaited_by() const noexcept;
  [[nodiscard]] display::Nanoseconds event_patience() const noexcept;
  [[nodiscard]] bool over() const noexcept {
    return outcome_.has_value() || stopping_.load(std::memory_order_acquire);
  }
  void publish() noexcept;

  display::Display& display_;
  Filler& filler_;
  PresenterStatistics& statistics_;
  const PresenterOptions options_;
  display::Nanoseconds period_;
  Pacer pacer_;
  uint64_t first_frame_ = 0;  ///< not 0 when the display was lost before it showed anything

  std::optional<PlayOutcome> outcome_;
  std::optional<uint64_t> end_vblank_;  ///< vblank with which playing ends
  PlayOutcome outcome_at_end_ = PlayOutcome::Finished;
  std::optional<PendingFlip> pending_;
  bool tick_requested_ = false;
  uint64_t tick_after_ = 0;                ///< the vblank after which the requested tick comes
  display::Nanoseconds tick_expected_{0};  ///< by when
  bool rebuffering_ = false;               ///< LatePolicy::Hold after an underrun
  std::optional<display::Nanoseconds> starved_since_;
  frames::Rate wanted_rate_;    ///< of the frame at the head, before it is locked to the display
  uint64_t cut_ = 0;            ///< of the source, as far as it has been followed
  bool after_cut_ = false;      ///< the first frame after the cut is awaited
  bool shows_one_more_ = true;  ///< although it is paused
  uint64_t last_sequence_ = 0;
  display::Nanoseconds last_vblank_{0};
  /// Our vblank number less the display's, whose count begins anew when it comes back.
  uint64_t count_ahead_ = 0;
  bool count_begins_anew_ = false;
  int events_lost_in_a_row_ = 0;
  int refused_in_a_row_ = 0;

  WakeFd wake_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> paused_{false};
};

}  // namespace lenticule::player
