// SPDX-License-Identifier: Apache-2.0
// Sums over the parts of a row that several threads work on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>

namespace lenticule::player {

struct Tally {
  uint64_t samples = 0;
  uint64_t failures = 0;
  double worst = 0.0;

  /// An error that is not a number is infinite.
  void error(double size) {
    worst = std::max(worst, std::isnan(size) ? std::numeric_limits<double>::infinity() : size);
  }
  void check(bool good) {
    ++samples;
    if (!good) ++failures;
  }
  Tally& operator+=(const Tally& other) {
    samples += other.samples;
    failures += other.failures;
    worst = std::max(worst, other.worst);
    return *this;
  }
};

/// The order of additions does not matter: sums of integers, and a maximum.
class SharedTally {
 public:
  void add(const Tally& part) {
    const std::lock_guard lock(mutex_);
    sum_ += part;
  }
  [[nodiscard]] const Tally& sum() const { return sum_; }

 private:
  std::mutex mutex_;
  Tally sum_;
};

}  // namespace lenticule::player
