// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/picture_oracle.h"

#include <cmath>

namespace lenticule::test {
namespace {

using Real = long double;

Real code(const frames::FrameView& picture, int i, int j, int channel) {
  return picture.row(j)[3 * i + channel];
}

Real luma(const frames::FrameView& picture, int i, int j) {
  return 0.299L * code(picture, i, j, 0) + 0.587L * code(picture, i, j, 1) +
         0.114L * code(picture, i, j, 2);
}

Real weight(int dx, int dy) {
  return std::exp(-static_cast<Real>(dx * dx + dy * dy) / (2.0L * 1.5L * 1.5L));
}

/// Returns the weighted mean of f(x, y) over the window about (i, j).
template <class F>
Real window_mean(int i, int j, F f) {
  Real sum = 0;
  Real weights = 0;
  for (int dy = -5; dy <= 5; ++dy)
    for (int dx = -5; dx <= 5; ++dx) {
      sum += weight(dx, dy) * f(i + dx, j + dy);
      weights += weight(dx, dy);
    }
  return sum / weights;
}

Real ssim_at(const frames::FrameView& a, const frames::FrameView& b, int i, int j) {
  const Real ma = window_mean(i, j, [&](int x, int y) { return luma(a, x, y); });
  const Real mb = window_mean(i, j, [&](int x, int y) { return luma(b, x, y); });
  const auto spread = [&](const frames::FrameView& p, Real mp, const frames::FrameView& q,
                          Real mq) {
    return window_mean(i, j,
                       [&](int x, int y) { return (luma(p, x, y) - mp) * (luma(q, x, y) - mq); });
  };
  const Real c1 = 6.5025L;   // (0.01 * 255)^2
  const Real c2 = 58.5225L;  // (0.03 * 255)^2
  return (2 * ma * mb + c1) * (2 * spread(a, ma, b, mb) + c2) /
         ((ma * ma + mb * mb + c1) * (spread(a, ma, a, ma) + spread(b, mb, b, mb) + c2));
}

}  // namespace

long double mse_by_definition(const frames::FrameView& a, const frames::FrameView& b, int channel) {
  Real sum = 0;
  Real count = 0;
  for (int j = 0; j < a.geometry.height; ++j)
    for (int i = 0; i < a.geometry.width; ++i)
      for (int c = 0; c < 3; ++c) {
        if (channel >= 0 && c != channel) continue;
        const Real difference = code(a, i, j, c) - code(b, i, j, c);
        sum += difference * difference;
        count += 1;
      }
  return sum / count;
}

long double psnr_by_definition(const frames::FrameView& a, const frames::FrameView& b,
                               int channel) {
  return 10.0L * std::log10(255.0L * 255.0L / mse_by_definition(a, b, channel));
}

long double ssim_by_definition(const frames::FrameView& a, const frames::FrameView& b) {
  Real sum = 0;
  Real count = 0;
  for (int j = 5; j + 5 < a.geometry.height; ++j)
    for (int i = 5; i + 5 < a.geometry.width; ++i) {
      sum += ssim_at(a, b, i, j);
      count += 1;
    }
  return sum / count;
}

}  // namespace lenticule::test
