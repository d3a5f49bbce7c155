// SPDX-License-Identifier: Apache-2.0
// Quantiles of values in any order.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace lenticule {

/// Returns the value that is at `place` in ascending order.
template <class Number>
[[nodiscard]] Number value_in_order(std::vector<Number> values, size_t place) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Returns the value that the fraction `part` of the other values does not exceed, rounded down to
/// one of the values: 0.5 is the lower median, 1 the largest value. 0 without values.
template <class Number>
[[nodiscard]] Number quantile(std::vector<Number> values, double part) {
  if (values.empty()) return Number{};
  const auto place = static_cast<size_t>(part * static_cast<double>(values.size() - 1));
  return value_in_order(std::move(values), place);
}

/// Returns the middle value, the upper one of two. 0 without values.
template <class Number>
[[nodiscard]] Number upper_median(std::vector<Number> values) {
  const size_t middle = values.size() / 2;
  return values.empty() ? Number{} : value_in_order(std::move(values), middle);
}

/// Returns the upper median of the magnitudes. 0 without values.
[[nodiscard]] inline double median_magnitude(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return upper_median(std::move(values));
}

/// Returns the median; the mean of the middle two for an even number of values. 0 without values.
[[nodiscard]] inline double median(const std::vector<double>& values) {
  if (values.empty()) return 0.0;
  return 0.5 * (quantile(values, 0.5) + upper_median(values));
}

}  // namespace lenticule
