// SPDX-License-Identifier: Apache-2.0
// VblankTimeline computes when the vblanks of a display with a known refresh occur, with integers
// only, so that the times do not drift.
#pragma once

#include <cstdint>

#include "display/display.h"
#include "frames/rational.h"

namespace lenticule::display {

/// Vblank n happens at origin + n * period, rounded down to a nanosecond. The period is stored as a
/// fraction: after 400 days the error is still below one nanosecond. Thread safety: any thread.
class VblankTimeline {
 public:
  /// Throws Error(Usage) if a term of the refresh exceeds kMaxTerm.
  VblankTimeline(Nanoseconds origin, frames::Rate refresh);

  /// Limit of a refresh's terms, as large as any pixel clock in hertz.
  static constexpr int64_t kMaxTerm = int64_t{1} << 32;

  [[nodiscard]] Nanoseconds time_of(uint64_t sequence) const noexcept;
  /// Returns the last vblank at or before `time`; 0 for times before the origin.
  [[nodiscard]] uint64_t sequence_at(Nanoseconds time) const noexcept;
  /// Returns one refresh period, rounded down.
  [[nodiscard]] Nanoseconds period() const noexcept;

 private:
  Nanoseconds origin_;
  frames::Rate refresh_;
};

}  // namespace lenticule::display
