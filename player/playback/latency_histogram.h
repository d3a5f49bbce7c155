// SPDX-License-Identifier: Apache-2.0
// LatencyHistogram computes percentiles of durations in constant memory: one writer that never
// waits, any number of readers.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>

namespace lenticule::player {

struct LatencySummary {
  uint64_t count = 0;
  double p50_us = 0;
  double p99_us = 0;
  double max_us = 0;
};

/// Uses sixteen bins per power of two, so that a percentile is at most 6 % too large; the maximum
/// is exact.
class LatencyHistogram {
 public:
  /// Records a duration; negative ones count as 0. Thread safety: the writer's thread.
  void record(std::chrono::nanoseconds duration) noexcept;
  /// Thread safety: any thread.
  [[nodiscard]] LatencySummary summary() const noexcept;

 private:
  static constexpr int kBinBits = 4;
  static constexpr int kOctaves = 44;  // up to five hours
  static constexpr size_t kBins = size_t{kOctaves} << kBinBits;

  [[nodiscard]] static size_t bin_of(uint64_t value) noexcept;
  [[nodiscard]] static uint64_t upper_bound_of(size_t bin) noexcept;

  std::array<std::atomic<uint64_t>, kBins> bins_{};
  std::atomic<uint64_t> max_{0};
};

}  // namespace lenticule::player
