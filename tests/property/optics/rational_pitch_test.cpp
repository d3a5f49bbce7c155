// SPDX-License-Identifier: Apache-2.0
// Tests rational pitches, at which whole columns of subpixels lie exactly on the border between two
// lenses. Integer arithmetic decides their lens: the half-open cell [-1/2, 1/2).
#include <gtest/gtest.h>

#include <cmath>

#include "optics/row_rays.h"

namespace lenticule::optics {
namespace {

/// Pitch = pitch_thirds / 3 subpixels, slant = slant_sixths / 6.
struct RationalSheet {
  int pitch_thirds;
  int slant_sixths;
};

constexpr int kWidth = 3840, kHeight = 2160;

Rig rational_rig(RationalSheet sheet) {
  Rig rig;
  rig.panel.width_px = kWidth;
  rig.panel.height_px = kHeight;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.1);
  rig.sheet.pitch = Subpixels(sheet.pitch_thirds / 3.0);
  rig.sheet.slant = sheet.slant_sixths / 6.0;
  rig.sheet.gap = Millimetres(1.0);
  return rig;
}

int64_t floor_divide(int64_t a, int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

/// lambda = numerator / denominator, exactly.
struct Fraction {
  int64_t numerator;
  int64_t denominator;
};
Fraction exact_lambda(RationalSheet sheet, int i, int j, int c) {
  // 12 (x + m y) from the centre, with x = i + 1/6 + c/3 - W/2 and y = j + 1/2 - H/2.
  const int64_t twelfths =
      2 * (6 * i + 1 + 2 * c - 3 * kWidth) + sheet.slant_sixths * (2 * j + 1 - kHeight);
  return {3 * twelfths, 4 * sheet.pitch_thirds};
}

class RationalPitch : public ::testing::TestWithParam<RationalSheet> {};

TEST_P(RationalPitch, GivesEverySubpixelToTheLensOfTheHalfOpenCell) {
  const OpticalModel model(rational_rig(GetParam()));
  const RowRayEvaluator evaluator(model);
  RowRays rays;
  int on_border = 0;
  for (int j = 0; j < kHeight; j += 37) {
    evaluator.evaluate(j, 0, kWidth, rays);
    for (int s = 0; s < 3 * kWidth; ++s) {
      const auto [n, d] = exact_lambda(GetParam(), s / 3, j, s % 3);
      const int64_t lens = floor_divide(2 * n + d, 2 * d);
      const bool border = 2 * n + d == 2 * d * lens;
      on_border += border ? 1 : 0;
      const auto at = static_cast<size_t>(s);
      ASSERT_EQ(rays.lens[at], lens) << "row " << j << " subpixel " << s;
      ASSERT_GE(rays.place[at], -0.5);
      ASSERT_LT(rays.place[at], 0.5);
      ASSERT_NEAR(rays.place[at], static_cast<double>(n - lens * d) / static_cast<double>(d), 1e-9);
      if (border || s % 101 == 0) {
        ASSERT_EQ(model.ray(s / 3, j, s % 3).lens, lens);
      }
    }
  }
  // Slants of whole thirds put many subpixels of some rows on a border, sixths put none there.
  const bool has_borders = GetParam().slant_sixths % 2 == 0 && GetParam().slant_sixths != 0;
  if (has_borders) {
    EXPECT_GT(on_border, 500);
  }
}

INSTANTIATE_TEST_SUITE_P(PitchesAndSlants, RationalPitch,
                         ::testing::Values(RationalSheet{18, 2}, RationalSheet{18, 1},
                                           RationalSheet{18, -2}, RationalSheet{18, 0},
                                           RationalSheet{16, 2}, RationalSheet{16, 1},
                                           RationalSheet{16, -1}, RationalSheet{24, 2}));

TEST(SplitPhase, IsHalfOpen) {
  EXPECT_EQ(split_phase(0.5).lens, 1);
  EXPECT_EQ(split_phase(0.5).place, -0.5);
  EXPECT_EQ(split_phase(-0.5).lens, 0);
  EXPECT_EQ(split_phase(-0.5).place, -0.5);
  EXPECT_EQ(split_phase(0.4999).lens, 0);
  EXPECT_EQ(split_phase(-0.5001).lens, -1);
  EXPECT_EQ(split_phase(-1e-20).lens, 0);
  EXPECT_EQ(split_phase(1e6 + 0.5).lens, 1'000'001);
}

TEST(SplitPhase, PutsRoundingErrorsBelowABorderOntoIt) {
  EXPECT_EQ(split_phase(std::nextafter(2.5, 0.0)).lens, 3);
  EXPECT_EQ(split_phase(std::nextafter(2.5, 0.0)).place, -0.5);
  EXPECT_EQ(split_phase(2.5 - 1e-11).lens, 3);
  EXPECT_EQ(split_phase(2.5 - 1e-9).lens, 2);
}

}  // namespace
}  // namespace lenticule::optics
