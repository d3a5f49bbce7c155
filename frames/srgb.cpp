// SPDX-License-Identifier: Apache-2.0
#include "frames/srgb.h"

#include <cmath>
#include <limits>

namespace lenticule::frames {
namespace {

/// Codes finds code values by comparing with the light half way between codes: this is exact and
/// avoids a power function per value. Bins are narrower than the light between two codes, so that
/// at most one limit lies within a bin.
struct Codes {
  static constexpr size_t kBins = 4096;

  Codes() {
    for (size_t code = 0; code < 255; ++code)
      limit[code] = linear_from_srgb((static_cast<double>(code) + 0.5) / 255.0);
    limit[255] = std::numeric_limits<double>::infinity();
    uint8_t code = 0;
    for (size_t bin = 0; bin < kBins; ++bin) {
      while (static_cast<double>(bin) / kBins >= limit[code]) ++code;
      first[bin] = code;
    }
  }

  std::array<double, 256> limit;     ///< between a code and the next one
  std::array<uint8_t, kBins> first;  ///< code at the start of each bin
};

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
  static const Codes codes;
  if (!(linear > 0.0)) return 0;
  if (linear >= 1.0) return 255;
  const uint8_t code = codes.first[static_cast<size_t>(linear * double{Codes::kBins})];
  return linear >= codes.limit[code] ? static_cast<uint8_t>(code + 1) : code;
}

}  // namespace lenticule::frames
