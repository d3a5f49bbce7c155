// SPDX-License-Identifier: Apache-2.0
#include "frames/srgb.h"

#include <cmath>
#include <limits>

#include "frames/linear_codes.h"

namespace lenticule::frames {
namespace {

/// Codes finds code values by comparing with the light half way between codes: this is exact and
/// avoids a power function per value. Bins are narrower than the light between two codes, so that
/// at most one limit lies within a bin.
struct Codes {
  static constexpr size_t kBins = LinearCodes::kBins;

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

const Codes& exact_codes() {
  static const Codes codes;
  return codes;
}

/// Returns the least number of single precision that is not below a limit.
float rounded_up(double limit) {
  const auto nearest = static_cast<float>(limit);
  return double{nearest} < limit ? std::nextafter(nearest, 2.0F) : nearest;
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
  const Codes& codes = exact_codes();
  if (!(linear > 0.0)) return 0;
  if (linear >= 1.0) return 255;
  const uint8_t code = codes.first[static_cast<size_t>(linear * double{Codes::kBins})];
  return linear >= codes.limit[code] ? static_cast<uint8_t>(code + 1) : code;
}

const LinearCodes& linear_codes() {
  static const LinearCodes table = [] {
    LinearCodes codes{};
    for (size_t bin = 0; bin < Codes::kBins; ++bin) {
      const uint8_t code = exact_codes().first[bin];
      const double limit = exact_codes().limit[code];
      const double end = static_cast<double>(bin + 1) / Codes::kBins;
      codes.first[bin] = code;
      codes.limit[bin] = limit < end ? rounded_up(limit) : std::numeric_limits<float>::infinity();
    }
    return codes;
  }();
  return table;
}

}  // namespace lenticule::frames
