// SPDX-License-Identifier: Apache-2.0
// KmsCounters holds the counters of a running KMS display. docs/play/kms.md explains each figure.
#pragma once

#include <atomic>
#include <cstdint>

#include "display/kms/scanout/kms_display.h"

namespace lenticule::display {

/// Thread safety: one writer, any number of readers.
class Count {
 public:
  void add() noexcept { value_.fetch_add(1, std::memory_order_relaxed); }
  [[nodiscard]] uint64_t get() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> value_{0};
};

/// Thread safety: written by the presenter thread, read by any; updates of different counters are
/// not ordered.
struct KmsCounters {
  Count flips, busy, denied, refused, flip_timeouts, stray_events, truncated_reads, recoveries,
      modesets, hotplugs, links_bad, suspends, pauses, lost_ticks;
  std::atomic<PanelState> panel{PanelState::Showing};
  std::atomic<bool> hardware_clock{false};
  std::atomic<bool> off{false};

  std::atomic<Nanoseconds::rep> largest_skew_ns{0};

  /// Notes by how much the tiles of a panel began to show a frame at different times.
  void note_skew(Nanoseconds skew) noexcept {
    if (skew.count() > largest_skew_ns.load(std::memory_order_relaxed))
      largest_skew_ns.store(skew.count(), std::memory_order_relaxed);
  }

  [[nodiscard]] KmsStatistics snapshot() const noexcept;
};

}  // namespace lenticule::display
