// SPDX-License-Identifier: Apache-2.0
// Interval is a closed interval of doubles. The unit depends on the field that holds the interval.
#pragma once

#include <limits>

namespace lenticule {

/// Interval is empty until its first extend().
struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void extend(double value) {
    low = value < low ? value : low;
    high = value > high ? value : high;
  }
  /// An empty interval extends nothing.
  void extend(const Interval& other) {
    if (other.empty()) return;
    extend(other.low);
    extend(other.high);
  }
  [[nodiscard]] bool empty() const { return !(low <= high); }
  [[nodiscard]] double width() const { return high - low; }
  [[nodiscard]] double largest() const { return -low > high ? -low : high; }
  friend Interval operator+(Interval a, Interval b) { return {a.low + b.low, a.high + b.high}; }
  /// Returns the interval extended by `by` at both ends.
  [[nodiscard]] Interval widened(double by) const { return {low - by, high + by}; }
};

inline constexpr Interval kEverywhere{-std::numeric_limits<double>::infinity(),
                                      std::numeric_limits<double>::infinity()};

}  // namespace lenticule
