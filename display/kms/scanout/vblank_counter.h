// SPDX-License-Identifier: Apache-2.0
// VblankCounter extends a driver's vblank counter to 64 bits, or derives the count from time.
#pragma once

#include <cstdint>

#include "display/vblank_timeline.h"

namespace lenticule::display {

struct Vblank {
  uint64_t sequence = 0;
  Nanoseconds time{0};
};

/// The count never runs backwards, even if the driver's does. Thread safety: one thread.
class VblankCounter {
 public:
  enum class Source {
    Hardware,  ///< the driver's sequence numbers
    Software,  ///< time divided by period, for drivers without vblank counter
  };

  VblankCounter(Source source, frames::Rate refresh, Vblank now);

  [[nodiscard]] Source source() const { return source_; }
  /// Switches to counting by time.
  void use_software(Nanoseconds now);
  /// Call when the driver's counter may have been reset: the next event continues from the current
  /// count.
  void rebase(Nanoseconds now);

  /// Extends the low 32 bits of a flip event. Corrects a sequence from the past and a zero or
  /// impossible timestamp.
  Vblank observe_low_bits(uint32_t sequence, Nanoseconds time, Nanoseconds now);
  /// Same for the driver's 64-bit sequence.
  Vblank observe(uint64_t driver_sequence, Nanoseconds time, Nanoseconds now);

  /// Returns the driver's number for the vblank `sequence` of this counter.
  [[nodiscard]] uint64_t driver_sequence(uint64_t sequence) const { return sequence - offset_; }

  /// Return, by the clock, the first vblank at or after `time`, and the last one at or before it.
  [[nodiscard]] Vblank first_from(Nanoseconds time) const;
  [[nodiscard]] Vblank last_until(Nanoseconds time) const;
  [[nodiscard]] Vblank at(uint64_t sequence) const;
  [[nodiscard]] Nanoseconds period() const { return timeline_.period(); }
  [[nodiscard]] const Vblank& last() const { return last_; }

 private:
  Vblank accept(uint64_t sequence, Nanoseconds time, Nanoseconds now);
  void anchor(Vblank vblank);

  Source source_;
  frames::Rate refresh_;
  VblankTimeline timeline_;  ///< its vblank 0 is base_
  uint64_t base_;
  Vblank last_;
  uint64_t offset_ = 0;  ///< this counter's number minus the driver's
  bool rebasing_ = false;
};

}  // namespace lenticule::display
