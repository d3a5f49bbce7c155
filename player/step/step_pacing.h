// SPDX-License-Identifier: Apache-2.0
// StepPacing keeps one player's schedule with the timeline of its group: the presenter asks it by
// how many vblanks the schedule must move. It reads no clock.
//
// A panel that is in step is corrected in steps of 0.05 vblank, at most once in 60 vblanks; each
// time the corrections add up to a vblank, the cadence repeats or drops one frame. A player that is
// further away is moved by one vblank in four until it is in step. No frame goes back.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <utility>

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
                                                  std::chrono::nanoseconds time) const noexcept {
    // In units of 1 / numerator nanoseconds, so that a loop is a whole number of units.
    const Int128 frame_units = kSecond * rate.denominator;
    const Int128 ahead = static_cast<Int128>(number) - static_cast<Int128>(frame);
    Int128 late =
        (static_cast<Int128>(time.count()) - due.count()) * rate.numerator - ahead * frame_units;
    if (loop_frames > 0) {
      const Int128 loop = static_cast<Int128>(loop_frames) * frame_units;
      late -= floor_divided(late + loop / 2, loop) * loop;
    }
    late = floor_divided(late, rate.numerator);
    return std::chrono::nanoseconds(
        static_cast<int64_t>(std::clamp<Int128>(late, -kMaxTime, kMaxTime)));
  }
  /// Returns the same timeline stated for the first frame that is due after `time`.
  [[nodiscard]] StepTimeline stated_after(std::chrono::nanoseconds time) const noexcept {
    const Int128 frame_units = kSecond * rate.denominator;
    const Int128 elapsed = (static_cast<Int128>(time.count()) - due.count()) * rate.numerator;
    Int128 ahead = floor_divided(elapsed, frame_units) + 1;
    Int128 number = static_cast<Int128>(frame) + ahead;
    if (loop_frames > 0) {
      const auto loop = static_cast<Int128>(loop_frames);
      number -= floor_divided(number, loop) * loop;
    } else if (number < 0) {  // before the first frame
      ahead -= number;
      number = 0;
    }
    StepTimeline stated = *this;
    stated.frame = static_cast<uint64_t>(number);
    stated.due += std::chrono::nanoseconds(
        static_cast<int64_t>(floor_divided(ahead * frame_units, rate.numerator)));
    return stated;
  }
  /// Returns the same timeline on another clock, which is `ahead` of this one.
  [[nodiscard]] StepTimeline on_clock_ahead_by(std::chrono::nanoseconds ahead) const noexcept {
    StepTimeline moved = *this;
    moved.due += ahead;
    return moved;
  }
  /// Returns true if no calculation with this timeline overflows. A received timeline must be
  /// checked.
  [[nodiscard]] bool valid() const noexcept {
    const auto term = [](int64_t value) { return value >= 1 && value <= kMaxTerm; };
    return term(rate.numerator) && term(rate.denominator) && frame <= kMaxFrames &&
           loop_frames <= kMaxFrames && due.count() > -kMaxTime && due.count() < kMaxTime;
  }
  friend bool operator==(const StepTimeline&, const StepTimeline&) = default;

 private:
  __extension__ typedef __int128 Int128;
  static constexpr Int128 kSecond = 1'000'000'000;
  static constexpr int64_t kMaxTerm = 1'000'000'000;
  static constexpr uint64_t kMaxFrames = 1'000'000'000'000;
  static constexpr int64_t kMaxTime = int64_t{1} << 62;  // the year 2116

  static Int128 floor_divided(Int128 value, Int128 divisor) noexcept {
    const Int128 quotient = value / divisor;
    return value % divisor < 0 ? quotient - 1 : quotient;
  }
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
  [[nodiscard]] double correction(const StepSample& sample) noexcept {
    // A frame is moved once, before its time: later it could only be late.
    if (place_.started != 0 && sample.index == last_index_) return 0.0;
    learn_loop(sample);
    place_.started = 1;
    place_.next_frame = sample.frame;
    place_.next_due_ns = sample.due.count();
    place_.rate = sample.rate;
    place_.period_ns = sample.period.count();
    const StepTimeline group = timeline();
    const double shift = group.rate.numerator > 0 ? correction_to(group, sample) : 0.0;
    published_.publish(place_);
    return shift;
  }
  /// Reports that the schedule was moved: the next frame is displayed `vblanks` later.
  void moved(int vblanks) noexcept {
    if (vblanks > 0) place_.repeated += static_cast<uint64_t>(vblanks);
    if (vblanks < 0) place_.dropped += static_cast<uint64_t>(-vblanks);
  }
  /// Reports that a frame appeared at this vblank.
  void shown(uint64_t frame, std::chrono::nanoseconds vblank) noexcept {
    place_.shown_frame = frame;
    place_.shown_ns = vblank.count();
    const StepTimeline group = timeline();
    if (group.rate.numerator > 0 && place_.period_ns > 0) {
      const std::chrono::nanoseconds late = group.lateness(frame, vblank);
      const double vblanks =
          static_cast<double>(late.count()) / static_cast<double>(place_.period_ns);
      // A frame belongs to the vblank period that contains its due time: it appears half a vblank
      // before that time on average.
      place_.difference = static_cast<int64_t>((vblanks + 0.5) * kMillion);
      if (place_.in_step != 0)
        place_.largest_difference =
            std::max(place_.largest_difference, std::abs(place_.difference));
    }
    published_.publish(place_);
  }

 private:
  /// A player is in step when its schedule is within the tolerance, and remains so until it is
  /// this many vblanks away.
  static constexpr double kLost = 1.0;
  static constexpr double kMillion = 1e6;
  /// Vblanks after which the drift is measured well enough.
  static constexpr uint64_t kDriftVblanks = 600;

  /// Learns the length of the loop when the numbers of the frames begin again.
  void learn_loop(const StepSample& sample) noexcept {
    const uint64_t before = std::exchange(last_index_, sample.index);
    if (place_.started == 0 || sample.index < before || sample.frame > place_.next_frame) return;
    const uint64_t length = place_.next_frame + (sample.index - before) - sample.frame;
    if (length > 0) place_.loop_frames = length;
  }
  [[nodiscard]] double correction_to(const StepTimeline& group, const StepSample& sample) noexcept {
    const std::chrono::nanoseconds late_by = group.lateness(sample.frame, sample.due);
    const double late =
        static_cast<double>(late_by.count()) / static_cast<double>(sample.period.count());
    update_state(late, sample.vblank);
    measure_drift(late, sample.vblank);
    const uint64_t pause = place_.in_step != 0 ? kStepTrackingVblanks : kStepJoiningVblanks;
    if (std::abs(late) <= kStepTolerance || sample.vblank < last_correction_ + pause) return 0.0;
    const double shift = -std::clamp(late, -1.0, 1.0);
    last_correction_ = sample.vblank;
    corrected_ += shift;
    return shift;
  }
  void update_state(double late, uint64_t vblank) noexcept {
    const double away = std::abs(late);
    if (place_.in_step == 0 && away <= kStepTolerance) {
      place_.in_step = 1;
      ++place_.joined;
      in_step_since_ = vblank;
      late_at_start_ = late;
      corrected_ = 0.0;
    } else if (away > kLost) {
      place_.in_step = 0;
    }
  }
  void measure_drift(double late, uint64_t vblank) noexcept {
    if (place_.in_step == 0 || vblank < in_step_since_ + kDriftVblanks) return;
    const double drifted = late - late_at_start_ - corrected_;
    place_.drift_ppb =
        static_cast<int64_t>(drifted * 1e9 / static_cast<double>(vblank - in_step_since_));
  }
  /// Returns the timeline of the group; its rate is 0 if it is not known.
  [[nodiscard]] StepTimeline timeline() const noexcept {
    StepTimeline timeline = target_.read();
    if (timeline.loop_frames == 0) timeline.loop_frames = place_.loop_frames;
    return timeline;
  }

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
