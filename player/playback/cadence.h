// SPDX-License-Identifier: Apache-2.0
// Cadence computes for how many vblanks each content frame stays: 24 on 60 Hz is 2, 3, 2, 3,
// forever.
#pragma once

#include <cstdint>

#include "frames/rational.h"

namespace lenticule::player {

/// Returns the rate at which content is played on this display. Content within 0.5 % of the
/// refresh, of a whole fraction or of a multiple of it is locked to it (60 on 59.94 runs 0.1 %
/// slow, without a stutter). A broadcast rate is locked to the cadence of its sibling rate (24 on
/// 59.94). All other content is played at its exact rate.
[[nodiscard]] frames::Rate locked_rate(frames::Rate content, frames::Rate refresh);

/// Returns the rate times `permille` thousandths, in lowest terms.
[[nodiscard]] frames::Rate scaled_rate(frames::Rate rate, uint32_t permille) noexcept;

/// Frame k is due floor(k * refresh / content) vblanks after frame 0: the vblank period that
/// contains its ideal time. The integer accumulator is exact forever; no 64-bit product overflows.
class Cadence {
 public:
  Cadence(frames::Rate content, frames::Rate refresh);

  /// Return the index of the current frame and its vblank, both counted from frame 0.
  [[nodiscard]] uint64_t frame() const noexcept { return frame_; }
  [[nodiscard]] uint64_t due() const noexcept { return due_; }
  /// Returns the vblank at which the frame after the current one is due.
  [[nodiscard]] uint64_t next_due() const noexcept;
  /// Advances to the next frame.
  void advance() noexcept;
  /// Returns the ideal time of the current frame less due(), in vblanks: 0 or more, below 1.
  [[nodiscard]] double fraction() const noexcept;
  void set_fraction(double fraction) noexcept;

 private:
  // More than 64 bits are needed only for rates like 9007199254740993/150119987579016.
  __extension__ typedef unsigned __int128 Uint128;

  Uint128 whole_;      ///< vblanks per frame, rounded down
  Uint128 remainder_;  ///< remainder of that division, in units of 1 / divisor_
  Uint128 divisor_;
  Uint128 fraction_ = 0;
  uint64_t frame_ = 0;
  uint64_t due_ = 0;
};

}  // namespace lenticule::player
