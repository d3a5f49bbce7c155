// SPDX-License-Identifier: Apache-2.0
// Tests the fit on observations made by formula, so that all errors come from the fit.
#include "calib/fit/joint_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "calib/fit/prediction.h"

namespace lenticule::calib {
namespace {

/// Three cameras in front of a known sheet, with noise of known size.
class FitStage {
 public:
  explicit FitStage(unsigned seed, double phase_noise = 0.004) : random_(seed) {
    panel_.width_px = 3840;
    panel_.height_px = 2160;
    panel_.pixel_width = panel_.pixel_height = Millimetres(0.1557);
    ground_truth_ = {
        1.5 * 3840 / 7.70123, 1.5 * 0.2521 * 2160 / 7.70123, 0.31, 2.19, 0.46, 0.02, 0.03};
    const std::array<Vec3, 3> eyes = {Vec3{10, 20, 700}, Vec3{-240, 0, 690}, Vec3{265, 30, 720}};
    for (const Vec3& eye : eyes) add_view(eye, phase_noise);
  }

  [[nodiscard]] const std::vector<View>& views() const { return views_; }
  [[nodiscard]] const optics::Panel& panel() const { return panel_; }
  [[nodiscard]] const SheetParameters& ground_truth() const { return ground_truth_; }
  [[nodiscard]] SheetStart start(double gap_factor) const {
    SheetStart start{.values = ground_truth_};
    start.values[kGap] *= gap_factor;
    start.values[kShape] = 0.5;
    start.values[kAberration] = start.values[kSag] = 0.0;
    return start;
  }

 private:
  /// Returns the pose of a camera at `eye` that looks at the panel's centre.
  static PoseValues looking_at_centre(const Vec3& eye) {
    const Vec3 forward = normalized(-eye);
    const Vec3 right = normalized(cross(forward, Vec3{0, 1, 0}));
    const Vec3 down = cross(forward, right);
    Eigen::Matrix3d m;
    m << right.x, right.y, right.z, down.x, down.y, down.z, forward.x, forward.y, forward.z;
    const Eigen::AngleAxisd turn(m);
    const Eigen::Vector3d axis = turn.angle() * turn.axis();
    return {axis[0], axis[1], axis[2], eye.x, eye.y, eye.z};
  }

  void add_view(const Vec3& eye, double phase_noise) {
    std::normal_distribution<double> normal;
    const CameraValues camera = {1400.0, 965.0, 536.0, -0.03, 0.0};
    const PoseValues pose = looking_at_centre(eye);
    View view{.name = "view",
              .fringe = {.pitch_subpx = 7.75, .slant = 0.2521, .phase = 0.0},
              .picture_width = 1920,
              .picture_height = 1080,
              .geometry = {},
              .phases = {}};
    for (double v = 20.0; v < 1080.0; v += 40.0)
      for (double u = 20.0; u < 1920.0; u += 40.0) {
        const auto lens = lens_plane_point(camera.data(), pose.data(), u, v);
        const auto wide = wide_pattern_point(pose.data(), ground_truth_.data(), panel_, lens);
        const auto q = fringe_point(pose.data(), ground_truth_.data(), panel_, lens);
        const Vec2 at{panel_.x_px(wide.x), panel_.y_px(wide.y)};
        if (at.x < 0 || at.y < 0 || at.x > 3840 || at.y > 2160) continue;
        view.geometry.push_back(
            {.camera_px = {u, v},
             .panel_px = {at.x + 0.1 * normal(random_), at.y + 0.1 * normal(random_)},
             .sigma_px = 0.1});
        const double turns = fringe_turns(view.fringe, panel_, q) -
                             lens_coordinate(ground_truth_.data(), panel_, lens);
        view.phases.push_back(
            {.camera_px = {u, v}, .turns = turns + phase_noise * normal(random_), .sigma = 0.004});
      }
    views_.push_back(view);
  }

  std::mt19937 random_;
  optics::Panel panel_;
  SheetParameters ground_truth_{};
  std::vector<View> views_;
};

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

TEST(JointFit, IsWithinItsOwnStandardErrors) {
  const FitStage stage(3);
  const std::optional<JointFit> fit = fitted(stage, 0.9);
  ASSERT_TRUE(fit);
  for (int k = 0; k < kSheetCount; ++k) {
    const double sigma = std::sqrt(fit->covariance(k, k));
    EXPECT_GT(sigma, 0.0);
    EXPECT_LT(std::abs(fit->values.sheet[static_cast<size_t>(k)] -
                       stage.ground_truth()[static_cast<size_t>(k)]),
              4.5 * sigma)
        << k;
  }
  EXPECT_NEAR(fit->phase_rms, 0.004, 0.001);
  EXPECT_NEAR(fit->geometry_rms_px, 0.1, 0.02);
  EXPECT_NEAR(fit->phase_scale, 1.0, 0.1);
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

// One error that is the same everywhere exceeds 1.96 standard errors in 5 % of the cases; the
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
  EXPECT_NEAR(ratio(), 1.96, 0.1);
  for (int knot = 0; knot < kSmallMap.count(); ++knot)
    fit->covariance(kSheetCount + knot, kSheetCount + knot) = 4.0 * kSigma * kSigma;
  EXPECT_GT(ratio(), 2.3);
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
