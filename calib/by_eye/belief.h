// SPDX-License-Identifier: Apache-2.0
// Belief combines answers to "which band is the best?" into the probability of each value, although
// some answers are wrong (a noisy search, see R. Karp and R. Kleinberg, "Noisy binary search and
// its applications", 2007).
#pragma once

#include <cstddef>
#include <vector>

namespace lenticule::calib {

/// Belief is the probability distribution of one quantity. Its unit is one lens from edge to edge
/// of the panel: the change of pitch or slant that adds one stripe.
class Belief {
 public:
  /// Starts with equal probabilities from -range to +range.
  explicit Belief(double range);

  /// Adds the answer to a chart with the values centre - reach ... centre + reach. A `band` that
  /// the chart does not have means that none of its bands is the best.
  void add(double centre, double reach, int band);

  /// Returns the most probable value.
  [[nodiscard]] double best() const;
  /// Returns the probability of the values within `distance` of `value`.
  [[nodiscard]] double probability_near(double value, double distance) const;

 private:
  [[nodiscard]] double value_of(size_t n) const;

  double range_;
  std::vector<double> probability_;  ///< sum 1
};

}  // namespace lenticule::calib
