// SPDX-License-Identifier: Apache-2.0
// Strong types for quantities that are easily confused: a length on the panel, a length in
// subpixels, a count of lenses, an angle. They have no run-time cost and convert only explicitly.
#pragma once

#include <compare>
#include <numbers>

namespace lenticule {

template <class Tag>
struct Quantity {
  double value = 0.0;

  constexpr Quantity() = default;
  constexpr explicit Quantity(double v) : value(v) {}

  friend constexpr Quantity operator+(Quantity a, Quantity b) {
    return Quantity(a.value + b.value);
  }
  friend constexpr Quantity operator-(Quantity a, Quantity b) {
    return Quantity(a.value - b.value);
  }
  friend constexpr Quantity operator-(Quantity a) { return Quantity(-a.value); }
  friend constexpr Quantity operator*(Quantity a, double s) { return Quantity(a.value * s); }
  friend constexpr Quantity operator*(double s, Quantity a) { return Quantity(a.value * s); }
  friend constexpr Quantity operator/(Quantity a, double s) { return Quantity(a.value / s); }
  friend constexpr double operator/(Quantity a, Quantity b) { return a.value / b.value; }
  friend constexpr auto operator<=>(Quantity, Quantity) = default;
};

using Millimetres = Quantity<struct MillimetresTag>;
/// Subpixels counts thirds of a pixel along a pixel row, in every subpixel layout.
using Subpixels = Quantity<struct SubpixelsTag>;
/// Lenses counts periods of the sheet.
using Lenses = Quantity<struct LensesTag>;
using Radians = Quantity<struct RadiansTag>;

constexpr Radians radians_from_degrees(double degrees) {
  return Radians(degrees * std::numbers::pi / 180.0);
}
constexpr double degrees_from_radians(Radians angle) {
  return angle.value * 180.0 / std::numbers::pi;
}

}  // namespace lenticule
