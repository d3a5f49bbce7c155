// SPDX-License-Identifier: Apache-2.0
// Computes LDR-FLIP of one pixel by the paper's formulas, with each filter as one square of
// weights.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/support/oracles/picture_oracle.h"

namespace lenticule::test {
namespace {

using Real = long double;
using Colour = std::array<Real, 3>;
using Matrix = std::array<Colour, 3>;

constexpr Real kPi = std::numbers::pi_v<Real>;

// Matrix from linear sRGB to XYZ under D65.
constexpr Matrix kXyzFromRgb = {
    {{10135552.0L / 24577794, 8788810.0L / 24577794, 4435075.0L / 24577794},
     {2613072.0L / 12288897, 8788810.0L / 12288897, 887015.0L / 12288897},
     {1425312.0L / 73733382, 8788810.0L / 73733382, 70074185.0L / 73733382}}};

Colour times(const Matrix& m, const Colour& v) {
  Colour out{};
  for (size_t r = 0; r < 3; ++r) out[r] = m[r][0] * v[0] + m[r][1] * v[1] + m[r][2] * v[2];
  return out;
}

Real determinant(const Matrix& m) {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/// Solves m v = b for v by Cramer's rule.
Colour solved(const Matrix& m, const Colour& b) {
  Colour v{};
  for (size_t column = 0; column < 3; ++column) {
    Matrix replaced = m;
    for (size_t r = 0; r < 3; ++r) replaced[r][column] = b[r];
    v[column] = determinant(replaced) / determinant(m);
  }
  return v;
}

Colour white() { return times(kXyzFromRgb, {1, 1, 1}); }

Real linear(Real encoded) {
  return encoded > 0.04045L ? std::pow((encoded + 0.055L) / 1.055L, 2.4L) : encoded / 12.92L;
}

/// Returns Y Cx Cz of a pixel; border pixels are repeated outward.
Colour opponent(const frames::FrameView& picture, int i, int j) {
  i = std::clamp(i, 0, picture.geometry.width - 1);
  j = std::clamp(j, 0, picture.geometry.height - 1);
  Colour rgb{};
  for (int c = 0; c < 3; ++c)
    rgb[static_cast<size_t>(c)] = linear(picture.row(j)[3 * i + c] / 255.0L);
  const Colour xyz = times(kXyzFromRgb, rgb);
  const Colour w = white();
  return {116 * xyz[1] / w[1] - 16, 500 * (xyz[0] / w[0] - xyz[1] / w[1]),
          200 * (xyz[1] / w[1] - xyz[2] / w[2])};
}

Real curve(Real t) {
  const Real delta = 6.0L / 29;
  return t > delta * delta * delta ? std::cbrt(t) : t / (3 * delta * delta) + 4.0L / 29;
}

/// Returns Hunt-adjusted L*a*b* of linear sRGB.
Colour adjusted(const Colour& rgb) {
  const Colour xyz = times(kXyzFromRgb, rgb);
  const Colour w = white();
  const Real x = curve(xyz[0] / w[0]);
  const Real y = curve(xyz[1] / w[1]);
  const Real z = curve(xyz[2] / w[2]);
  const Real lightness = 116 * y - 16;
  return {lightness, 0.01L * lightness * 500 * (x - y), 0.01L * lightness * 200 * (y - z)};
}

Real hyab(const Colour& p, const Colour& q) {
  return std::abs(p[0] - q[0]) + std::hypot(p[1] - q[1], p[2] - q[2]);
}

Real sensitivity(size_t channel, Real degrees_squared) {
  struct Terms {
    Real a1, b1, a2, b2;
  };
  static constexpr std::array<Terms, 3> kTerms = {
      {{1, 0.0047L, 0, 1}, {1, 0.0053L, 0, 1}, {34.1L, 0.04L, 13.5L, 0.025L}}};
  const Terms& t = kTerms[channel];
  return t.a1 * std::sqrt(kPi / t.b1) * std::exp(-kPi * kPi * degrees_squared / t.b1) +
         t.a2 * std::sqrt(kPi / t.b2) * std::exp(-kPi * kPi * degrees_squared / t.b2);
}

Colour blurred_lab(const frames::FrameView& picture, int i, int j, Real ppd) {
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(0.04L / (2 * kPi * kPi)) * ppd));
  Colour sum{};
  Colour weights{};
  for (int dy = -radius; dy <= radius; ++dy)
    for (int dx = -radius; dx <= radius; ++dx) {
      const Colour here = opponent(picture, i + dx, j + dy);
      for (size_t c = 0; c < 3; ++c) {
        const Real weight = sensitivity(c, (dx * dx + dy * dy) / (ppd * ppd));
        sum[c] += weight * here[c];
        weights[c] += weight;
      }
    }
  for (size_t c = 0; c < 3; ++c) sum[c] /= weights[c];
  const Real y = (sum[0] + 16) / 116;
  const Colour w = white();
  Colour rgb =
      solved(kXyzFromRgb, {w[0] * (y + sum[1] / 500), w[1] * y, w[2] * (y - sum[2] / 200)});
  for (Real& part : rgb) part = std::clamp(part, Real{0}, Real{1});
  return adjusted(rgb);
}

Real feature(const frames::FrameView& picture, int i, int j, Real ppd, bool edge) {
  const Real sigma = 0.5L * 0.082L * ppd;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const auto weight = [&](int along, int beside) {
    const Real gauss = std::exp(-(along * along + beside * beside) / (2 * sigma * sigma));
    return edge ? -along * gauss : (along * along / (sigma * sigma) - 1) * gauss;
  };
  Real positive = 0;
  Real negative = 0;
  for (int b = -radius; b <= radius; ++b)
    for (int a = -radius; a <= radius; ++a)
      (weight(a, b) > 0 ? positive : negative) += std::abs(weight(a, b));
  Real across = 0;
  Real down = 0;
  for (int dy = -radius; dy <= radius; ++dy)
    for (int dx = -radius; dx <= radius; ++dx) {
      const Real grey = (opponent(picture, i + dx, j + dy)[0] + 16) / 116;
      const Real wx = weight(dx, dy);
      const Real wy = weight(dy, dx);
      across += grey * wx / (wx > 0 ? positive : negative);
      down += grey * wy / (wy > 0 ? positive : negative);
    }
  return std::hypot(across, down);
}

Real colour_error(Real distance) {
  const Real largest = std::pow(hyab(adjusted({0, 1, 0}), adjusted({0, 0, 1})), 0.7L);
  const Real raised = std::pow(distance, 0.7L);
  const Real border = 0.4L * largest;
  if (raised < border) return 0.95L * raised / border;
  return 0.95L + 0.05L * (raised - border) / (largest - border);
}

}  // namespace

long double flip_by_definition(const frames::FrameView& reference, const frames::FrameView& test,
                               int i, int j, double pixels_per_degree) {
  const Real ppd = pixels_per_degree;
  const Real colour =
      colour_error(hyab(blurred_lab(reference, i, j, ppd), blurred_lab(test, i, j, ppd)));
  const auto apart = [&](bool edge) {
    return std::abs(feature(reference, i, j, ppd, edge) - feature(test, i, j, ppd, edge));
  };
  const Real features =
      std::min(Real{1}, std::sqrt(std::max(apart(true), apart(false)) / std::sqrt(Real{2})));
  return std::pow(colour, 1 - features);
}

}  // namespace lenticule::test
