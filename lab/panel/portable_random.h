// SPDX-License-Identifier: Apache-2.0
// PortableRandom generates random numbers that are equal on every machine, unlike the distributions
// of the standard library.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace lenticule::lab {

/// Scrambles 64 bits (finaliser of splitmix64).
[[nodiscard]] constexpr uint64_t scramble(uint64_t bits) {
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebULL;
  return bits ^ (bits >> 31);
}

class PortableRandom {
 public:
  explicit PortableRandom(uint64_t seed) : state_(scramble(seed + 0x9e3779b97f4a7c15ULL)) {}

  [[nodiscard]] uint64_t bits() { return scramble(state_ += 0x9e3779b97f4a7c15ULL); }
  /// Returns a number in [0, 1).
  [[nodiscard]] double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  [[nodiscard]] double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Returns a Gaussian number with mean 0 and standard deviation 1.
  [[nodiscard]] double gaussian() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

 private:
  uint64_t state_;
};

}  // namespace lenticule::lab
