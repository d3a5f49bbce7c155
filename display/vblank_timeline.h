// SPDX-License-Identifier: Apache-2.0
// When the vblanks of a display with a known refresh happen: integers only, so that nothing drifts.
#pragma once

#include <cstdint>

#include "display/display.h"
#include "frames/rational.h"

namespace lenticule::display {

/// Vblank n happens at origin + n * period, rounded down to a nanosecond. The period stays a
/// fraction: after 400 days the error is still below one nanosecond. Any thread.
class VblankTimeline {
 public:
  /// Throws Error(Usage) when a term of the refresh exceeds kMaxTerm.
  VblankTimeline(Nanoseconds origin, frames::Rate refresh);

  /// Terms of a refresh: as large as any pixel clock in hertz.
  static constexpr int64_t kMaxTerm = int64_t{1} << 32;

  [[nodiscard]] Nanoseconds time_of(uint64_t sequence) const noexcept;
  /// The last vblank at or before `time`; 0 for times before the origin.
  [[nodiscard]] uint64_t sequence_at(Nanoseconds time) const noexcept;
  /// One refresh period, rounded down.
  [[nodiscard]] Nanoseconds period() const noexcept;

 private:
  Nanoseconds origin_;
  frames::Rate refresh_;
};

}  // namespace lenticule::display
