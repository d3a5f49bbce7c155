// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/reference_sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lenticule::test {
namespace {

constexpr uint32_t kGolden = 0x9e3779b9U;

uint32_t mix(uint32_t x) {
  x = (x ^ (x >> 16)) * 0x7feb352dU;
  x = (x ^ (x >> 15)) * 0x846ca68bU;
  return x ^ (x >> 16);
}

bool bit(uint32_t x, int k) { return (x >> k & 1) != 0; }

uint32_t backwards(uint32_t x) {
  uint32_t out = 0;
  for (int k = 0; k < 32; ++k)
    if (bit(x, k)) out |= 1U << (31 - k);
  return out;
}

/// Scrambles binary digits after the point. Owen's scrambling works on the digits in reverse order.
double scrambled(uint32_t digits, uint32_t seed) {
  uint32_t x = backwards(digits);
  x ^= x * 0x3d20adeaU;
  x += seed;
  x *= (seed >> 16) | 1U;
  x ^= x * 0x05526c56U;
  x ^= x * 0x53a22864U;
  return std::floor(backwards(x) / 256.0) / 16777216.0;
}

/// Applies the matrix of Sobol's second dimension: binomial coefficients modulo 2.
uint32_t second_dimension(uint32_t index) {
  uint32_t digits = 0;
  for (int row = 0; row < 32; ++row) {
    bool odd = false;
    // C(k, row) is odd if row's bits are a subset of k's.
    for (int k = row; k < 32; ++k) odd ^= bit(index, k) && (row & ~k) == 0;
    if (odd) digits |= 1U << (31 - row);
  }
  return digits;
}

}  // namespace

uint32_t reference_path(uint32_t path, bool refracted) {
  return mix(path * kGolden + (refracted ? 1 : 0));
}

uint32_t reference_seed(int row, int subpixel, int sample) {
  return mix(mix(mix(static_cast<uint32_t>(row) + kGolden) + static_cast<uint32_t>(subpixel)) +
             static_cast<uint32_t>(sample));
}

SquarePoint reference_point(uint32_t seed, uint32_t path, uint32_t use, uint32_t index) {
  const uint32_t first = mix(seed ^ mix(path + use * kGolden));
  const uint32_t second = mix(first + kGolden);
  return {scrambled(backwards(index), first), scrambled(second_dimension(index), second)};
}

Vec3 reference_on_disc(SquarePoint point) {
  const double a = 2.0 * point.u - 1.0;
  const double b = 2.0 * point.v - 1.0;
  if (a == 0.0 && b == 0.0) return {};
  constexpr double kQuarter = std::numbers::pi / 4.0;
  if (std::abs(a) > std::abs(b))
    return {a * std::cos(kQuarter * b / a), a * std::sin(kQuarter * b / a), 0.0};
  return {b * std::sin(kQuarter * a / b), b * std::cos(kQuarter * a / b), 0.0};
}

Vec3 reference_turned(Vec3 across, Vec3 axis) {
  // A mirror halfway between the axis and the z axis; y is turned back if that axis is -z.
  const double side = axis.z < -0.31 ? -1.0 : 1.0;
  const Vec3 half = axis + Vec3{0.0, 0.0, side};
  const Vec3 before{across.x, side * across.y, 0.0};
  return before - half * (2.0 * dot(before, half) / dot(half, half));
}

Vec3 reference_cosine_direction(SquarePoint point, Vec3 axis) {
  const Vec3 at = reference_on_disc(point);
  return reference_turned(at, axis) +
         axis * std::sqrt(std::max(0.0, 1.0 - at.x * at.x - at.y * at.y));
}

}  // namespace lenticule::test
