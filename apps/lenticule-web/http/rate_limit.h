// SPDX-License-Identifier: Apache-2.0
// RateLimit counts events per address in token buckets.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <unordered_map>

namespace lenticule::web {

/// Thread safety: any thread.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;

  /// Permits `burst` events at once and `per_second` on average, for each address.
  RateLimit(double burst, double per_second) : burst_(burst), per_second_(per_second) {}

  /// Counts one event; returns false, and counts nothing, if it is beyond the limit.
  [[nodiscard]] bool permits(const std::string& address, Clock::time_point now = Clock::now());
  /// Returns the number of addresses that are remembered; at most kMaxAddresses.
  [[nodiscard]] size_t addresses() const;

  static constexpr size_t kMaxAddresses = 4096;

 private:
  struct Bucket {
    double tokens = 0.0;
    Clock::time_point at{};
  };
  [[nodiscard]] double tokens_of(const Bucket& bucket, Clock::time_point now) const;
  void forget_full(Clock::time_point now);

  const double burst_;
  const double per_second_;
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Bucket> buckets_;
};

}  // namespace lenticule::web
