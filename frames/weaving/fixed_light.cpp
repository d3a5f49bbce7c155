// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/fixed_light.h"

#include <algorithm>
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

/// Parabola is one part of the light curve.
struct Parabola {
  int start = 0, rise = 0, bend = 0;

  [[nodiscard]] int at(int t) const {
    return start + ((t * (rise + ((t * bend + 4) >> 3)) + 4) >> 3);
  }
};

double exact_light(int code) {
  return kFull * linear_of_codes()[static_cast<size_t>(code)];
}

double furthest_off(const Parabola& parabola, int first_code) {
  double most = 0.0;
  for (int t = 0; t < 16; ++t)
    most = std::max(most, std::abs(parabola.at(t) - exact_light(first_code + t)));
  return most;
}

/// Returns the best parabola near the one through the first, a middle and the last code. The first
/// code of a part is as exact as possible: black stays black.
Parabola fitted(int first_code) {
  const double first = exact_light(first_code), last = exact_light(first_code + 15);
  const double middle = exact_light(first_code + 7);
  const double bend = ((last - first) / 15.0 - (middle - first) / 7.0) / (15.0 - 7.0);
  const int start = static_cast<int>(std::lround(first));
  const int about = static_cast<int>(std::lround(64.0 * bend));
  Parabola best;
  double least = kFull;
  for (int b = std::max(about - 8, 0); b <= about + 8; ++b) {
    const int rise = static_cast<int>(std::lround(8.0 * (last - first) / 15.0 - 15.0 * b / 8.0));
    for (int r = std::max(rise - 3, 0); r <= rise + 3; ++r) {
      const Parabola tried{start, r, b};
      const double off = furthest_off(tried, first_code);
      if (off >= least || tried.at(15) > kFull) continue;
      least = off;
      best = tried;
    }
  }
  return best;
}

}  // namespace

const LightCurve& light_curve() {
  static const LightCurve curve = [] {
    LightCurve parts{};
    for (size_t n = 0; n < 16; ++n) {
      const Parabola part = fitted(static_cast<int>(16 * n));
      parts.start_low[n] = static_cast<uint8_t>(part.start & 0xff);
      parts.start_high[n] = static_cast<uint8_t>(part.start >> 8);
      parts.rise_low[n] = static_cast<uint8_t>(part.rise & 0xff);
      parts.rise_high[n] = static_cast<uint8_t>(part.rise >> 8);
      parts.bend[n] = static_cast<uint8_t>(part.bend);
    }
    return parts;
  }();
  return curve;
}

const std::array<uint16_t, 256>& light_of_codes15() {
  static const std::array<uint16_t, 256> table = [] {
    const LightCurve& curve = light_curve();
    std::array<uint16_t, 256> light{};
    for (size_t code = 0; code < light.size(); ++code) {
      const size_t n = code / 16;
      const Parabola part{.start = curve.start_low[n] | curve.start_high[n] << 8,
                          .rise = curve.rise_low[n] | curve.rise_high[n] << 8,
                          .bend = curve.bend[n]};
      light[code] = static_cast<uint16_t>(part.at(static_cast<int>(code % 16)));
    }
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
