// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/fixed_light.h"

#include <cmath>
#include <memory>

#include "frames/srgb.h"

namespace lenticule::frames {
namespace {

constexpr double kFull = 32767.0;
constexpr int kPointBits = 7;  ///< fraction of a code in the curve's points

double point_of(int light) {
  return std::ldexp(255.0 * srgb_from_linear(light / kFull), kPointBits);
}

void fill_part(std::array<int16_t, 64>& start, std::array<int16_t, 64>& rise, int step) {
  for (int n = 0; n < 64; ++n) {
    const double here = std::round(point_of(n * step));
    const double next = std::round(point_of((n + 1) * step));
    start[static_cast<size_t>(n)] = static_cast<int16_t>(here + (1 << (kPointBits - 1)));
    rise[static_cast<size_t>(n)] = static_cast<int16_t>(next - here);
  }
}

uint8_t encode(int light) {
  const EncodingCurve& curve = encoding_curve();
  const bool low = light < kLowLight;
  const auto n = static_cast<size_t>(low ? light >> 5 : light >> 9);
  const int part = (low ? light << 10 : light << 6) & 0x7fff;
  const int start = low ? curve.low_start[n] : curve.high_start[n];
  const int rise = low ? curve.low_rise[n] : curve.high_rise[n];
  return static_cast<uint8_t>((start + ((rise * part + 0x4000) >> 15)) >> kPointBits);
}

}  // namespace

const std::array<uint16_t, 256>& light_of_codes15() {
  static const std::array<uint16_t, 256> table = [] {
    std::array<uint16_t, 256> light{};
    for (size_t code = 0; code < light.size(); ++code)
      light[code] = static_cast<uint16_t>(std::lround(linear_of_codes()[code] * kFull));
    return light;
  }();
  return table;
}

const EncodingCurve& encoding_curve() {
  static const EncodingCurve curve = [] {
    EncodingCurve points{};
    fill_part(points.low_start, points.low_rise, 32);
    fill_part(points.high_start, points.high_rise, 512);
    return points;
  }();
  return curve;
}

const std::array<uint8_t, 32768>& codes_of_light15() {
  static const auto table = [] {
    auto codes = std::make_unique<std::array<uint8_t, 32768>>();
    for (int light = 0; light < 32768; ++light)
      (*codes)[static_cast<size_t>(light)] = encode(light);
    return codes;
  }();
  return *table;
}

}  // namespace lenticule::frames
