// SPDX-License-Identifier: Apache-2.0
// Rate is an exact rational rate: 24000/1001 stays 24000/1001.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace lenticule::frames {

/// Rate is a positive rate per second. make_rate() and parse_rate() return it in lowest terms.
struct Rate {
  int64_t numerator = 60;
  int64_t denominator = 1;

  [[nodiscard]] double hertz() const {
    return static_cast<double>(numerator) / static_cast<double>(denominator);
  }
  friend bool operator==(const Rate&, const Rate&) = default;
};

/// Returns the rate in lowest terms. Throws Error(Usage) unless both numbers are positive and the
/// rate lies in [1/3600, 10000] Hz.
[[nodiscard]] Rate make_rate(int64_t numerator, int64_t denominator);

/// Parses "60", "59.94" (the broadcast rates 23.976, 29.97, 47.952, 59.94, 119.88 mean
/// n*1000/1001), "24000/1001", "12.5". Throws Error(Usage).
[[nodiscard]] Rate parse_rate(std::string_view text);

[[nodiscard]] std::string to_string(Rate rate);

}  // namespace lenticule::frames
