// SPDX-License-Identifier: Apache-2.0
// StepPacing keeps one player's schedule with the timeline of its group: the presenter asks it by
// how many vblanks the schedule must move. It reads no clock.
//
// A panel that is in step is corrected in steps of 0.05 vblank, at most once in 60 vblanks; each
// time the corrections add up to a vblank, the cadence repeats or drops one frame. A player that is
// further away is moved by one vblank in four until it is in step. No frame goes back.
#pragma once

#include <chrono>
#include <cstdint>

#include "base/live_value.h"
#include "frames/rational.h"

namespace lenticule::player {

/// StepTimeline states when each frame of a repeated sequence is due for all players of a group.
/// Frame `frame` is due at `due`; later frames follow at `rate`. All arithmetic is exact.
struct StepTimeline {
  uint64_t frame = 0;               ///< number within the sequence
  std::chrono::nanoseconds due{0};  ///< time of the clock that the timeline's owner uses
  frames::Rate rate{60, 1};
  uint64_t loop_frames = 0;  ///< length of the repeated sequence; 0 = unknown

  /// Returns `time` less the time at which frame `number` is due: its nearest repetition, if the
  /// length of the loop is known.
  [[nodiscard]] std::chrono::nanoseconds lateness(uint64_t number,
                                                  std::chrono::nanoseconds time) const noexcept;
  /// Returns the same timeline stated for the first frame that is due after `time`.
  [[nodiscard]] StepTimeline stated_after(std::chrono::nanoseconds time) const noexcept;
  /// Returns the same timeline on another clock, which is `ahead` of this one.
  [[nodiscard]] StepTimeline on_clock_ahead_by(std::chrono::nanoseconds ahead) const noexcept;
  /// Returns true if no calculation with this timeline overflows. A received timeline must be
  /// checked.
  [[nodiscard]] bool valid() const noexcept;
  friend bool operator==(const StepTimeline&, const StepTimeline&) = default;
};

/// One vblank in this many is repeated or dropped while a player is not in step.
inline constexpr uint64_t kStepJoiningVblanks = 4;
/// The least number of vblanks between two corrections of a player that is in step.
inline constexpr uint64_t kStepTrackingVblanks = 60;
/// The least difference in vblanks that is corrected.
inline constexpr double kStepTolerance = 0.05;

/// The figures and the place of a player, read by the thread that talks to the group.
struct StepPlace {
  uint64_t started = 0;     ///< 1 once a frame is scheduled
  uint64_t next_frame = 0;  ///< number of the next frame
  int64_t next_due_ns = 0;  ///< ideal time of that frame, CLOCK_MONOTONIC
  frames::Rate rate{60, 1};
  int64_t period_ns = 0;     ///< time between two vblanks of the display
  uint64_t loop_frames = 0;  ///< learned when the sequence repeated; 0 = not yet
  uint64_t shown_frame = 0;  ///< number of the last displayed frame
  int64_t shown_ns = 0;      ///< vblank at which that frame appeared, CLOCK_MONOTONIC; 0 = none yet
  uint64_t in_step = 0;      ///< 1 if the player keeps the timeline
  uint64_t joined = 0;       ///< times that the player came into step
  /// Vblank at which the last frame appeared less its due time, in millionths of a vblank:
  /// -500000 ... 500000 in step.
  int64_t difference = 0;
  int64_t largest_difference = 0;  ///< largest absolute value while in step
  uint64_t repeated = 0;           ///< vblanks added
  uint64_t dropped = 0;            ///< vblanks left out
  /// Period of the panel less that of the timeline, in parts per billion.
  int64_t drift_ppb = 0;
};

/// The next frame as the presenter's schedule has it.
struct StepSample {
  uint64_t frame = 0;               ///< number within the sequence
  uint64_t index = 0;               ///< number over all loops
  uint64_t vblank = 0;              ///< the next vblank
  std::chrono::nanoseconds due{0};  ///< ideal time of the frame, CLOCK_MONOTONIC
  std::chrono::nanoseconds period{0};
  frames::Rate rate{60, 1};
};

/// Thread safety: presenter only, except where stated.
class StepPacing {
 public:
  StepPacing() noexcept { target_.publish({.rate = {.numerator = 0, .denominator = 1}}); }

  /// Sets the timeline on CLOCK_MONOTONIC. Thread safety: any one thread.
  void follow(const StepTimeline& timeline) noexcept { target_.publish(timeline); }
  /// Returns the place in the timeline. Thread safety: any thread.
  [[nodiscard]] StepPlace place() const noexcept { return published_.read(); }

  /// Returns the vblanks by which the schedule must move now, -1 to 1; usually 0.
  [[nodiscard]] double correction(const StepSample& sample) noexcept;
  /// Reports that the schedule was moved: the next frame is displayed `vblanks` later.
  void moved(int vblanks) noexcept;
  /// Reports that a frame appeared at this vblank.
  void shown(uint64_t frame, std::chrono::nanoseconds vblank) noexcept;

 private:
  void learn_loop(const StepSample& sample) noexcept;
  [[nodiscard]] double correction_to(const StepTimeline& group, const StepSample& sample) noexcept;
  void update_state(double late, uint64_t vblank) noexcept;
  void measure_drift(double late, uint64_t vblank) noexcept;
  [[nodiscard]] StepTimeline timeline() const noexcept;

  LiveValue<StepTimeline> target_;  ///< on CLOCK_MONOTONIC; its rate is 0 until it is known
  LiveValue<StepPlace> published_;
  StepPlace place_;
  uint64_t last_index_ = 0;
  uint64_t last_correction_ = 0;  ///< vblank of the last correction
  uint64_t in_step_since_ = 0;    ///< vblank
  double late_at_start_ = 0.0;    ///< lateness in vblanks when the player came into step
  double corrected_ = 0.0;        ///< sum of the corrections since then, in vblanks
};

}  // namespace lenticule::player
