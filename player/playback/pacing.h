// SPDX-License-Identifier: Apache-2.0
// Pacer decides which frame is shown at which vblank, by arithmetic on vblank numbers alone: no
// clock, no input or output. The statistics count vblanks of the display's counter and are not
// estimated from clocks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>

#include "frames/rational.h"

namespace lenticule::player {

/// Returns the rate at which content is played on this display. Content within 0.5 % of the
/// refresh, of a whole fraction or of a multiple of it is locked to it (60 on 59.94 runs 0.1 %
/// slow, without a stutter). A broadcast rate is locked to the cadence of its sibling rate (24 on
/// 59.94). All other content is played at its exact rate.
[[nodiscard]] frames::Rate locked_rate(frames::Rate content, frames::Rate refresh);

/// Returns the rate times `permille` thousandths, in lowest terms.
[[nodiscard]] frames::Rate scaled_rate(frames::Rate rate, uint32_t permille) noexcept;

/// Cadence computes for how many vblanks each content frame stays: 24 on 60 Hz is 2, 3, 2, 3,
/// forever.
/// Frame k is due floor(k * refresh / content) vblanks after frame 0: the vblank period that
/// contains its ideal time. The integer accumulator is exact forever; no 64-bit product overflows.
class Cadence {
 public:
  Cadence(frames::Rate content, frames::Rate refresh) {
    const Uint128 vblanks = Uint128{static_cast<uint64_t>(refresh.numerator)} *
                            static_cast<uint64_t>(content.denominator);
    divisor_ = Uint128{static_cast<uint64_t>(refresh.denominator)} *
               static_cast<uint64_t>(content.numerator);
    whole_ = vblanks / divisor_;
    remainder_ = vblanks % divisor_;
    // set_fraction() needs more than the few places that 60 on 60 Hz has.
    if (divisor_ >= kFinePlaces) return;
    remainder_ *= kFinePlaces;
    divisor_ *= kFinePlaces;
  }

  /// Return the index of the current frame and its vblank, both counted from frame 0.
  [[nodiscard]] uint64_t frame() const noexcept { return frame_; }
  [[nodiscard]] uint64_t due() const noexcept { return due_; }
  /// Returns the vblank at which the frame after the current one is due.
  [[nodiscard]] uint64_t next_due() const noexcept {
    const bool carry = fraction_ + remainder_ >= divisor_;
    return due_ + static_cast<uint64_t>(whole_) + (carry ? 1 : 0);
  }
  /// Advances to the next frame.
  void advance() noexcept {
    due_ = next_due();
    fraction_ += remainder_;
    if (fraction_ >= divisor_) fraction_ -= divisor_;
    ++frame_;
  }
  /// Returns the ideal time of the current frame less due(), in vblanks: 0 or more, below 1.
  [[nodiscard]] double fraction() const noexcept {
    return static_cast<double>(fraction_) / static_cast<double>(divisor_);
  }
  void set_fraction(double fraction) noexcept {
    fraction_ =
        std::min(static_cast<Uint128>(fraction * static_cast<double>(divisor_)), divisor_ - 1);
  }

 private:
  static constexpr uint64_t kFinePlaces = uint64_t{1} << 20;
  // More than 64 bits are needed only for rates like 9007199254740993/150119987579016.
  __extension__ typedef unsigned __int128 Uint128;

  Uint128 whole_;      ///< vblanks per frame, rounded down
  Uint128 remainder_;  ///< remainder of that division, in units of 1 / divisor_
  Uint128 divisor_;
  Uint128 fraction_ = 0;
  uint64_t frame_ = 0;
  uint64_t due_ = 0;
};

/// Effect of a late frame on the schedule.
enum class LatePolicy {
  Slip,  ///< every frame is shown; all later ones move by the delay
  Drop,  ///< late frames are left out (at most kMaxConsecutiveDrops, then it slips)
  Hold,  ///< like Slip, but after an underrun the picture holds until the source is primed again
};

inline constexpr int kMaxConsecutiveDrops = 8;

/// Parses "slip", "drop" or "hold". Throws Error(Usage).
[[nodiscard]] LatePolicy parse_late_policy(std::string_view text);
[[nodiscard]] const char* late_policy_name(LatePolicy policy);

/// Every vblank from the first flip on belongs to exactly one of the first five counts: vblanks =
/// shown + repeated_planned + repeated_underrun + missed + held.
struct PaceCounts {
  uint64_t shown = 0;              ///< flips: vblanks at which a new frame appeared
  uint64_t repeated_planned = 0;   ///< repeats required by the cadence
  uint64_t repeated_underrun = 0;  ///< repeats because the next frame was not available
  uint64_t missed = 0;             ///< vblanks lost because a flip completed too late
  uint64_t held = 0;               ///< vblanks with no frame due: paused, or after the last frame
  uint64_t vblanks = 0;
  uint64_t dropped = 0;          ///< frames left out because they were late
  uint64_t skipped_planned = 0;  ///< frames left out because content is faster than the display
  uint64_t slipped = 0;          ///< vblanks by which the schedule moved
  uint64_t underruns = 0;        ///< times (not vblanks) the next frame was not available
  uint64_t underruns_after_start = 0;  ///< underruns after the first second
  friend bool operator==(const PaceCounts&, const PaceCounts&) = default;
};

enum class PaceDecision {
  Submit,   ///< show frame() now
  Later,    ///< not before vblank due(): decide again one vblank before that
  Starved,  ///< frame() is due, but not available
  Skip,     ///< frame() is left out; frame() now returns the next one
};

/// Pacer keeps the schedule of one playback. Thread safety: one thread.
class Pacer {
 public:
  Pacer(frames::Rate content, frames::Rate refresh, LatePolicy policy)
      : content_(locked_rate(content, refresh)),
        refresh_(refresh),
        policy_(policy),
        start_up_vblanks_(static_cast<uint64_t>(refresh.hertz()) + 1),
        cadence_(content_, refresh_) {}

  /// Returns the index of the frame to show next, counted from 0 over all loops.
  [[nodiscard]] uint64_t frame() const noexcept { return base_frame_ + cadence_.frame(); }
  /// Returns the vblank from which frame() should be displayed. Meaningless before the first flip.
  [[nodiscard]] uint64_t due() const noexcept { return origin_ + cadence_.due(); }

  /// Decides what to do now. `target` is the first vblank that a submission made now can reach;
  /// `ready` is true if frame() can be submitted.
  [[nodiscard]] PaceDecision decide(uint64_t target, bool ready) noexcept {
    if (epoch_pending_) return ready ? PaceDecision::Submit : PaceDecision::Starved;
    if (target < due()) return PaceDecision::Later;
    if (!owed_since_) owed_since_ = expected_vblank();
    if (!ready) {
      if (!starved_since_) starved_since_ = target;
      return PaceDecision::Starved;
    }
    // Dropping a late frame helps only if the frame after it is due as well.
    const bool replaceable = due() < target && origin_ + cadence_.next_due() <= target;
    if (policy_ == LatePolicy::Drop && replaceable && consecutive_drops_ < kMaxConsecutiveDrops) {
      ++consecutive_drops_;
      ++counts_.dropped;
      cadence_.advance();
      return PaceDecision::Skip;
    }
    return PaceDecision::Submit;
  }

  /// Reports that frame() was submitted for vblank `target`; `in_time` is false if it was so late
  /// that the display may not reach that vblank. A frame that became ready only then does not count
  /// as missed if it appears one vblank later: it was not available.
  void submitted(uint64_t target, bool in_time = true) noexcept {
    available_at_ = in_time ? target : target + 1;
  }
  /// Reports that the submitted frame has been displayed since vblank `sequence`; frame() is now
  /// the next one.
  void flipped(uint64_t sequence) noexcept {
    if (epoch_pending_) {
      begin_schedule(sequence);
    } else {
      // The counter of a working display never goes back; clamp the value of one that does.
      sequence = std::max(sequence, *shown_at_ + 1);
      const uint64_t expected = std::min(owed_since_.value_or(expected_vblank()), sequence);
      const uint64_t starved_from = std::max(starved_since_.value_or(sequence), expected);
      const uint64_t starved_to = std::max(std::min(available_at_, sequence), starved_from);
      account(expected, sequence, starved_to - starved_from);

      const bool gave_up_catching_up = consecutive_drops_ >= kMaxConsecutiveDrops;
      if (sequence > due() && (policy_ != LatePolicy::Drop || gave_up_catching_up)) {
        counts_.slipped += sequence - due();
        origin_ += sequence - due();
      }
    }
    owed_since_.reset();
    starved_since_.reset();
    consecutive_drops_ = 0;
    shown_at_ = sequence;
    ++counts_.shown;
    ++counts_.vblanks;
    advance_past_same_vblank();
  }

  /// Starts a new schedule with the next flip, after a pause or a seek, without a burst to catch
  /// up. The vblanks before that flip count as held.
  void begin_epoch() noexcept {
    epoch_pending_ = true;
    starved_since_.reset();
  }

  /// Changes the content's rate from frame() on; frame() stays due at the same vblank.
  void change_rate(frames::Rate content) noexcept {
    base_frame_ = frame();
    origin_ = due();
    content_ = locked_rate(content, refresh_);
    cadence_ = Cadence(content_, refresh_);
  }

  /// Continues with `frame` after the display was lost, as after a pause; its refresh may have
  /// changed. Counts are kept.
  void resume(frames::Rate content, frames::Rate refresh, uint64_t frame) noexcept {
    content_ = locked_rate(content, refresh);
    refresh_ = refresh;
    cadence_ = Cadence(content_, refresh_);
    base_frame_ = frame;
    owed_since_.reset();
    consecutive_drops_ = 0;
    begin_epoch();
  }

  /// Moves the schedule by -1 to 1 vblanks. Returns the number of vblanks by which frame() is
  /// displayed later: 0, 1 or -1. With LatePolicy::Drop a frame that is too late now is left out.
  int shift(double vblanks) noexcept {
    const double moved = cadence_.fraction() + vblanks;
    const double whole = std::floor(moved);
    origin_ += static_cast<uint64_t>(static_cast<int64_t>(whole));
    cadence_.set_fraction(moved - whole);
    return static_cast<int>(whole);
  }
  /// Returns true if due() is meaningful: the next flip begins no new schedule.
  [[nodiscard]] bool scheduled() const noexcept { return !epoch_pending_; }
  /// Returns the vblanks, with their fraction, from `sequence` to the ideal time of frame().
  [[nodiscard]] double vblanks_to_ideal(uint64_t sequence) const noexcept {
    return static_cast<double>(static_cast<int64_t>(due() - sequence)) + cadence_.fraction();
  }

  /// Reports that no more frames follow: a supposed underrun was the end of the sequence.
  void end_of_sequence() noexcept { starved_since_.reset(); }
  /// Ends the playback with vblank `end` (exclusive) and counts the last frame's vblanks. Call it
  /// once.
  void finish(uint64_t end) noexcept {
    if (!shown_at_ || end <= *shown_at_ + 1) return;
    const uint64_t tail = end - *shown_at_ - 1;
    const uint64_t expected = owed_since_.value_or(expected_vblank());
    const uint64_t planned = std::min(tail, expected - *shown_at_ - 1);
    const uint64_t starved = starved_since_ && *starved_since_ < end
                                 ? std::min(end - *starved_since_, tail - planned)
                                 : 0;
    counts_.repeated_planned += planned;
    counts_.held += tail - planned - starved;
    counts_.vblanks += tail;
    count_underrun(starved);
  }

  /// Returns the rate as played: locked to the display where possible.
  [[nodiscard]] frames::Rate content_rate() const noexcept { return content_; }
  [[nodiscard]] bool started() const noexcept { return shown_at_.has_value(); }
  [[nodiscard]] uint64_t first_vblank() const noexcept { return first_vblank_; }
  [[nodiscard]] const PaceCounts& counts() const noexcept { return counts_; }

 private:
  void begin_schedule(uint64_t sequence) noexcept {
    if (shown_at_) {
      sequence = std::max(sequence, *shown_at_ + 1);
      counts_.held += sequence - *shown_at_ - 1;
      counts_.vblanks += sequence - *shown_at_ - 1;
    } else {
      first_vblank_ = sequence;
    }
    base_frame_ = frame();
    cadence_ = Cadence(content_, refresh_);
    origin_ = sequence;
    epoch_pending_ = false;
  }
  /// Classifies the vblanks after the last flip, up to `end`: planned until `expected`, then
  /// starved, then missed.
  void account(uint64_t expected, uint64_t end, uint64_t starved) noexcept {
    const uint64_t planned = expected - *shown_at_ - 1;
    counts_.repeated_planned += planned;
    counts_.missed += end - expected - starved;
    counts_.vblanks += end - *shown_at_ - 1;
    count_underrun(starved);
  }
  void count_underrun(uint64_t starved) noexcept {
    if (starved == 0) return;
    counts_.repeated_underrun += starved;
    ++counts_.underruns;
    if (*starved_since_ > first_vblank_ + start_up_vblanks_) ++counts_.underruns_after_start;
  }
  /// Advances to the next frame; of several frames due at one vblank only the first is shown.
  void advance_past_same_vblank() noexcept {
    const uint64_t shown_due = cadence_.due();
    cadence_.advance();
    while (cadence_.due() == shown_due) {
      cadence_.advance();
      ++counts_.skipped_planned;
    }
  }
  [[nodiscard]] uint64_t expected_vblank() const noexcept {
    return shown_at_ ? std::max(due(), *shown_at_ + 1) : due();
  }

  frames::Rate content_;
  frames::Rate refresh_;
  LatePolicy policy_;
  uint64_t start_up_vblanks_;

  Cadence cadence_;
  uint64_t base_frame_ = 0;  ///< frame at which the schedule began
  uint64_t origin_ = 0;      ///< vblank at which the schedule began, moved by slips
  bool epoch_pending_ = true;

  uint64_t first_vblank_ = 0;
  std::optional<uint64_t> shown_at_;  ///< vblank of the last flip
  /// Vblank at which the next frame, or a dropped one before it, was due.
  std::optional<uint64_t> owed_since_;
  std::optional<uint64_t> starved_since_;  ///< first vblank without the frame that was due
  uint64_t available_at_ = 0;              ///< vblank that the submitted frame reaches for certain
  int consecutive_drops_ = 0;
  PaceCounts counts_;
};

}  // namespace lenticule::player
