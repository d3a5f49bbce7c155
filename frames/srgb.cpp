// SPDX-License-Identifier: Apache-2.0
#include "frames/srgb.h"

#include <algorithm>
#include <cmath>

namespace lenticule::frames {
namespace {

/// Returns a table whose element n is the light half way between codes n and n + 1: comparing with
/// it is exact and avoids a power function per value.
const std::array<double, 255>& light_between_codes() {
  static const std::array<double, 255> table = [] {
    std::array<double, 255> light{};
    for (size_t code = 0; code < light.size(); ++code)
      light[code] = linear_from_srgb((static_cast<double>(code) + 0.5) / 255.0);
    return light;
  }();
  return table;
}

}  // namespace

double linear_from_srgb(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

double srgb_from_linear(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}

const std::array<double, 256>& linear_of_codes() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> light{};
    for (size_t code = 0; code < light.size(); ++code)
      light[code] = linear_from_srgb(static_cast<double>(code) / 255.0);
    return light;
  }();
  return table;
}

uint8_t code_from_linear(double linear) {
  const auto& between = light_between_codes();
  const auto above =
      std::upper_bound(between.begin(), between.end(), linear,
                       [](double light, double border) { return !(light >= border); });
  return static_cast<uint8_t>(above - between.begin());
}

}  // namespace lenticule::frames
