// SPDX-License-Identifier: Apache-2.0
#include "player/playback/latency_histogram.h"

#include <algorithm>
#include <bit>

namespace lenticule::player {
namespace {

constexpr double kNanosecondsPerMicrosecond = 1000.0;

}  // namespace

size_t LatencyHistogram::bin_of(uint64_t value) noexcept {
  constexpr uint64_t kSubBins = uint64_t{1} << kBinBits;
  if (value < kSubBins) return static_cast<size_t>(value);
  const int shift = static_cast<int>(std::bit_width(value)) - 1 - kBinBits;
  const uint64_t bin = (static_cast<uint64_t>(shift) << kBinBits) + (value >> shift);
  return static_cast<size_t>(std::min<uint64_t>(bin, kBins - 1));
}

uint64_t LatencyHistogram::upper_bound_of(size_t bin) noexcept {
  constexpr uint64_t kSubBins = uint64_t{1} << kBinBits;
  if (bin < kSubBins) return bin;
  const auto shift = (bin >> kBinBits) - 1;
  return (((bin & (kSubBins - 1)) + kSubBins + 1) << shift) - 1;
}

void LatencyHistogram::record(std::chrono::nanoseconds duration) noexcept {
  const auto value = static_cast<uint64_t>(std::max<int64_t>(duration.count(), 0));
  auto& bin = bins_[bin_of(value)];
  bin.store(bin.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
}

LatencySummary LatencyHistogram::summary() const noexcept {
  std::array<uint64_t, kBins> bins;
  uint64_t total = 0;
  for (size_t i = 0; i < kBins; ++i) total += bins[i] = bins_[i].load(std::memory_order_relaxed);
  if (total == 0) return {};

  const uint64_t max = max_.load(std::memory_order_relaxed);
  const auto percentile_us = [&](uint64_t percent) {
    const uint64_t rank = (total * percent + 99) / 100;
    uint64_t seen = 0;
    size_t bin = 0;
    while (bin + 1 < kBins && (seen += bins[bin]) < rank) ++bin;
    return static_cast<double>(std::min(upper_bound_of(bin), max)) / kNanosecondsPerMicrosecond;
  };
  return {.count = total,
          .p50_us = percentile_us(50),
          .p99_us = percentile_us(99),
          .max_us = static_cast<double>(max) / kNanosecondsPerMicrosecond};
}

}  // namespace lenticule::player
