// SPDX-License-Identifier: Apache-2.0
// Tally sums up the parts of a row on which several threads work.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>
#include <string>

namespace lenticule::bench {

struct Tally {
  uint64_t samples = 0;
  uint64_t failures = 0;
  double worst = 0.0;

  /// Records an error; NaN counts as infinite.
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

/// NamedFailures records checks with names, for the note of a row.
class NamedFailures {
 public:
  void check(const std::string& name, bool good) {
    tally.check(good);
    if (!good) names_ += (names_.empty() ? "failed: " : ", ") + name;
  }
  /// Returns the names of failed checks; empty if none failed.
  [[nodiscard]] const std::string& names() const { return names_; }

  Tally tally;

 private:
  std::string names_;
};

/// SharedTally adds up parts from several threads. The result does not depend on the order: sums of
/// integers, and a maximum.
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

}  // namespace lenticule::bench
