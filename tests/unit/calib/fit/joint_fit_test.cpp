// SPDX-License-Identifier: Apache-2.0
// Tests the fit on observations made by formula, so that all errors come from the fit.
#include "calib/fit/joint_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/fit/prediction.h"
#include "fit_stage.h"

namespace lenticule::calib {
namespace {

using test::FitStage;

constexpr KnotGrid kSmallMap{.columns = 6, .rows = 4};

std::optional<JointFit> fitted(const FitStage& stage, double gap_factor) {
  const SheetStart start = stage.start(gap_factor);
  const std::optional<PoseFit> poses = fit_poses(stage.views(), start.values, stage.panel());
  if (!poses) return std::nullopt;
  const std::vector<GapCandidate> gaps = search_gaps(stage.views(), *poses, start, stage.panel());
  if (gaps.empty()) return std::nullopt;
  JointOptions options;
  options.grid = kSmallMap;
  return fit_jointly(stage.views(), *poses, start, gaps.front(), stage.panel(), options);
}

TEST(PoseFit, FindsTheCamera) {
  const FitStage stage(1);
  const std::optional<PoseFit> fit = fit_poses(stage.views(), stage.ground_truth(), stage.panel());
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->camera[kFocal], 1400.0, 1.0);
  EXPECT_NEAR(fit->camera[kCentreX], 965.0, 1.0);
  EXPECT_NEAR(fit->camera[kRadial1], -0.03, 2e-3);
  EXPECT_NEAR(fit->poses[1][kPupil], -240.0, 0.2);
  EXPECT_NEAR(fit->poses[2][kPupil + 2], 720.0, 0.5);
  EXPECT_NEAR(fit->rms_px, 0.1, 0.03);
}

TEST(GapSearch, FindsTheRightWholeLensesFromAFarStart) {
  const FitStage stage(2);
  for (const double factor : {0.6, 0.8, 1.3, 1.8}) {
    const SheetStart start = stage.start(factor);
    const std::optional<PoseFit> poses = fit_poses(stage.views(), start.values, stage.panel());
    ASSERT_TRUE(poses);
    const std::vector<GapCandidate> gaps = search_gaps(stage.views(), *poses, start, stage.panel());
    ASSERT_FALSE(gaps.empty());
    EXPECT_NEAR(gaps.front().gap_mm, stage.ground_truth()[kGap], 0.03) << "start " << factor;
    if (gaps.size() > 1) {
      EXPECT_GT(gaps[1].chi_squared - gaps[0].chi_squared, 60.0);
    }
  }
}

TEST(JointFit, StandardErrorsAgreeWithTheScatter) {
  // 40 runs give a standard deviation to 11 %.
  constexpr int kTimes = 40;
  std::array<double, kSheetCount> squares{}, variances{}, sums{};
  for (unsigned seed = 100; seed < 100 + kTimes; ++seed) {
    const FitStage stage(seed);
    const std::optional<JointFit> fit = fitted(stage, 0.95);
    ASSERT_TRUE(fit);
    for (size_t k = 0; k < kSheetCount; ++k) {
      const double off = fit->values.sheet[k] - stage.ground_truth()[k];
      squares[k] += off * off;
      sums[k] += off;
      variances[k] += fit->covariance(static_cast<int>(k), static_cast<int>(k));
    }
  }
  for (size_t k = 0; k < kSheetCount; ++k)
    EXPECT_NEAR(std::sqrt(squares[k] / variances[k]), 1.0, 0.3)
        << k << ": mean error in standard errors "
        << sums[k] / kTimes / std::sqrt(variances[k] / kTimes);
}

TEST(JointFit, DetectsBlocksThatStateTooLittleError) {
  const FitStage stage(5, 0.012);
  const std::optional<JointFit> fit = fitted(stage, 1.0);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->phase_scale, 3.0, 0.4);
}

TEST(Prediction, DriftGrowsAwayFromTheViewpoints) {
  const FitStage stage(6);
  const std::optional<JointFit> fit = fitted(stage, 1.0);
  ASSERT_TRUE(fit);
  const Prediction prediction(*fit, kSmallMap, stage.panel());
  const double near = prediction.worst_drift({{0, 0, 700}}).worst_lenses;
  const double far = prediction.worst_drift({{900, 0, 700}}).worst_lenses;
  EXPECT_GT(near, 0.0);
  EXPECT_GT(far, 1.5 * near);
  const EffectiveLine line = prediction.effective_line({0, 0, 700});
  EXPECT_NEAR(line.pitch_subpx.value, 7.70123 * (1.0 + 2.19 / 700.0), 7.7 * 5e-4);
  EXPECT_LT(line.pitch_subpx.sigma, 1e-5);
}

// One error that is the same everywhere exceeds 2.17 standard errors in 3 % of the cases; the
// largest of several independent errors exceeds them more often.
TEST(Prediction, TheLikelyLargestDriftCountsIndependentErrors) {
  const FitStage stage(6);
  std::optional<JointFit> fit = fitted(stage, 1.0);
  ASSERT_TRUE(fit);
  constexpr double kSigma = 0.01;
  const std::vector<Vec3> eyes = {{-200, 0, 700}, {200, 0, 700}};
  const auto ratio = [&] {
    const Prediction prediction(*fit, kSmallMap, stage.panel());
    return prediction.likely_largest_drift(eyes).worst_lenses /
           (0.5 * prediction.worst_drift(eyes).worst_lenses);
  };
  fit->covariance.setZero();
  fit->covariance(kOffset, kOffset) = kSigma * kSigma;
  EXPECT_NEAR(ratio(), 2.17, 0.1);
  for (int knot = 0; knot < kSmallMap.count(); ++knot)
    fit->covariance(kSheetCount + knot, kSheetCount + knot) = 4.0 * kSigma * kSigma;
  EXPECT_GT(ratio(), 2.5);
  EXPECT_LT(ratio(), 4.0);
}

TEST(Prediction, AddsTheModelsErrorsToNoise) {
  const FitStage stage(6);
  const std::optional<JointFit> fit = fitted(stage, 1.0);
  ASSERT_TRUE(fit);
  const auto sigmas = [&](const LawError& law) {
    const SheetReport report = Prediction(*fit, kSmallMap, stage.panel(), law).sheet_report();
    const auto sigma = [&](int k) {
      return report.parameters[static_cast<size_t>(k)].estimate.sigma;
    };
    return std::array<double, 3>{sigma(0), sigma(1), sigma(3)};
  };
  const auto noise = sigmas({});
  const auto added = [&](const LawError& law, size_t k) {
    const double all = sigmas(law)[k];
    return std::sqrt(std::max(0.0, all * all - noise[k] * noise[k]));
  };
  const double across = fit->values.sheet[kAcross];
  const LawError pitch{.pitch_lenses = 0.01};
  EXPECT_NEAR(added(pitch, 0), 7.70123 * 0.01 / across, 1e-8);
  EXPECT_NEAR(added(pitch, 1), 0.0, 1e-9);
  EXPECT_NEAR(added({.slant_lenses = 0.01}, 1), 0.01 / across * 3840 / 2160, 1e-8);
  EXPECT_NEAR(added({.gap_part = 0.01}, 2), 0.0219, 1e-4);
  EXPECT_NEAR(added({.gap_part = 0.01}, 0), 0.0, 1e-8);
}

}  // namespace
}  // namespace lenticule::calib
