// SPDX-License-Identifier: Apache-2.0
// Which frame at which vblank: pure arithmetic on vblank numbers, no clock, no input or output.
// What the statistics count are facts of the display's vblank counter, not guesses from clocks.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "player/playback/cadence.h"

namespace lenticule::player {

/// What becomes of the schedule when a frame is late.
enum class LatePolicy {
  Slip,  ///< every frame is shown; all later ones move by the delay
  Drop,  ///< late frames are left out (at most kMaxConsecutiveDrops, then it slips)
  Hold,  ///< as Slip, but after an underrun the picture holds until the source is primed again
};

inline constexpr int kMaxConsecutiveDrops = 8;

/// "slip", "drop" or "hold"; throws Error(Usage).
[[nodiscard]] LatePolicy parse_late_policy(std::string_view text);
[[nodiscard]] const char* late_policy_name(LatePolicy policy);

/// Every vblank from the first flip on is exactly one of the first five:
/// vblanks = shown + repeated_planned + repeated_underrun + missed + held.
struct PaceCounts {
  uint64_t shown = 0;              ///< flips: vblanks at which a new frame came
  uint64_t repeated_planned = 0;   ///< by the cadence
  uint64_t repeated_underrun = 0;  ///< because the next frame was not there
  uint64_t missed = 0;             ///< because a flip landed later than it should have
  uint64_t held = 0;  ///< because nothing more was owed: paused, or after the last frame
  uint64_t vblanks = 0;
  uint64_t dropped = 0;          ///< frames left out because they were late
  uint64_t skipped_planned = 0;  ///< frames left out because content is faster than the display
  uint64_t slipped = 0;          ///< vblanks by which the schedule moved
  uint64_t underruns = 0;        ///< times (not vblanks) the next frame was not there
  uint64_t underruns_after_start = 0;  ///< those later than the first second
  friend bool operator==(const PaceCounts&, const PaceCounts&) = default;
};

enum class PaceDecision {
  Submit,   ///< show frame() now
  Later,    ///< not before vblank due(): decide again one vblank before
  Starved,  ///< frame() is due, but not there
  Skip,     ///< forget frame(): it has been advanced to the next one
};

/// The schedule of one playback. One thread.
class Pacer {
 public:
  Pacer(frames::Rate content, frames::Rate refresh, LatePolicy policy);

  /// The frame to show next, counted from 0 over all loops.
  [[nodiscard]] uint64_t frame() const noexcept { return base_frame_ + cadence_.frame(); }
  /// The vblank from which frame() should be on the glass. Meaningless before the first flip.
  [[nodiscard]] uint64_t due() const noexcept { return origin_ + cadence_.due(); }

  /// `target` is the first vblank that a submission made now can reach; `ready` whether frame() is
  /// there to be submitted.
  [[nodiscard]] PaceDecision decide(uint64_t target, bool ready) noexcept;

  /// frame() was submitted, and should be on the glass at vblank `target`.
  void submitted(uint64_t target) noexcept;
  /// The submitted frame is on the glass since vblank `sequence`; frame() is now the next one.
  void flipped(uint64_t sequence) noexcept;

  /// After a pause or a seek: the next flip starts a new schedule, without a burst to catch up. The
  /// vblanks up to it count as held.
  void begin_epoch() noexcept {
    epoch_pending_ = true;
    starved_since_.reset();
  }

  /// From frame() on, which stays due when it is, the content goes at another rate.
  void change_rate(frames::Rate content) noexcept;

  /// The display itself was away: goes on with `frame`, by a cadence for what may be another
  /// refresh, as after a pause. Counts stay.
  void resume(frames::Rate content, frames::Rate refresh, uint64_t frame) noexcept;

  /// Nothing more comes: an underrun that seemed to have begun was the end of the sequence.
  void end_of_sequence() noexcept { starved_since_.reset(); }
  /// Playing ends with vblank `end` (exclusive): accounts for the last frame's stay. Once.
  void finish(uint64_t end) noexcept;

  /// As played: locked to the display where it can be.
  [[nodiscard]] frames::Rate content_rate() const noexcept { return content_; }
  [[nodiscard]] bool started() const noexcept { return shown_at_.has_value(); }
  [[nodiscard]] uint64_t first_vblank() const noexcept { return first_vblank_; }
  [[nodiscard]] const PaceCounts& counts() const noexcept { return counts_; }

 private:
  void begin_schedule(uint64_t sequence) noexcept;
  void account(uint64_t expected, uint64_t end, uint64_t starved) noexcept;
  void count_underrun(uint64_t starved) noexcept;
  void advance_past_same_vblank() noexcept;
  [[nodiscard]] uint64_t expected_vblank() const noexcept;

  frames::Rate content_;
  frames::Rate refresh_;
  LatePolicy policy_;
  uint64_t start_up_vblanks_;

  Cadence cadence_;
  uint64_t base_frame_ = 0;  ///< frame at which the schedule began
  uint64_t origin_ = 0;      ///< vblank at which it began, moved by slips
  bool epoch_pending_ = true;

  uint64_t first_vblank_ = 0;
  std::optional<uint64_t> shown_at_;       ///< vblank of the last flip
  std::optional<uint64_t> owed_since_;     ///< vblank at which the next frame, or one dropped
                                           ///< before it, should have come
  std::optional<uint64_t> starved_since_;  ///< first vblank without the frame that was due
  uint64_t target_ = 0;                    ///< of the submitted frame
  int consecutive_drops_ = 0;
  PaceCounts counts_;
};

}  // namespace lenticule::player
