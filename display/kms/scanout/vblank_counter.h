// SPDX-License-Identifier: Apache-2.0
// The 64-bit vblank count of a display, from what its driver counts or, without that, from time.
#pragma once

#include <cstdint>

#include "display/vblank_timeline.h"

namespace lenticule::display {

struct Vblank {
  uint64_t sequence = 0;
  Nanoseconds time{0};
};

/// Never runs backwards, whatever the driver says. One thread.
class VblankCounter {
 public:
  enum class Source {
    Hardware,  ///< the driver's sequences
    Software,  ///< time over period, for drivers without vblanks
  };

  VblankCounter(Source source, frames::Rate refresh, Vblank now);

  [[nodiscard]] Source source() const { return source_; }
  /// From now on, time counts.
  void use_software(Nanoseconds now);
  /// The driver's counter may have been reset: the next event continues from here.
  void rebase(Nanoseconds now);

  /// Extends the low 32 bits of a flip event. A sequence from the past, a zero or impossible
  /// timestamp are put right.
  Vblank observe_low_bits(uint32_t sequence, Nanoseconds time, Nanoseconds now);
  /// The same for a whole sequence of the driver.
  Vblank observe(uint64_t driver_sequence, Nanoseconds time, Nanoseconds now);

  /// What the driver calls the vblank that we call `sequence`.
  [[nodiscard]] uint64_t driver_sequence(uint64_t sequence) const { return sequence - offset_; }

  /// By the clock: the first vblank at or after `time`, the last one at or before it.
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
  VblankTimeline timeline_;  ///< its vblank 0 is our base_
  uint64_t base_;
  Vblank last_;
  uint64_t offset_ = 0;  ///< ours minus the driver's
  bool rebasing_ = false;
};

}  // namespace lenticule::display
