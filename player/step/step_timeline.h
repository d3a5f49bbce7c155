// SPDX-License-Identifier: Apache-2.0
// StepTimeline states when each frame of a repeated sequence is due for all players of a group.
#pragma once

#include <chrono>
#include <cstdint>

#include "frames/rational.h"

namespace lenticule::player {

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

}  // namespace lenticule::player
