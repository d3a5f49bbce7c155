// SPDX-License-Identifier: Apache-2.0
// The photographs are made with another pitch, slant and offset than the chart was drawn for.
#include "calib/photo/single_photo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "optics/model.h"
#include "photo_stage.h"

namespace lenticule::calib {
namespace {

using test::desk_rig;
using test::photograph;
using test::PhotoStage;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// The chart of a rig whose pitch is 0.4 % off, drawn once for all tests.
struct Shown {
  SinglePhotoChart chart;
  frames::WovenFrame frame;
};
const Shown& shown() {
  static const Shown kShown = [] {
    optics::Rig start = desk_rig();
    start.sheet.pitch.value *= 1.004;
    start.sheet.slant += 0.006;
    start.sheet.offset = Lenses(0.0);
    Shown out{plan_single_photo_chart(start), {}};
    out.frame = draw_single_photo_chart(out.chart);
    return out;
  }();
  return kShown;
}

PhotoStage stage() {
  PhotoStage stage;
  stage.rig = desk_rig();
  stage.noise = 0.03;
  return stage;
}

/// As somebody measures with a tape.
PhotoPriors tape(const PhotoStage& stage) {
  PhotoPriors priors;
  priors.distance_mm = Estimate{stage.eye_mm.z, 3.0};
  return priors;
}

double without_lenses(double phase) {
  return phase - std::round(phase);
}

/// Largest error of the phase over the panel, seen by the eye found, against the truth.
double worst_phase(const Calibration& found, const PhotoStage& stage) {
  const optics::OpticalModel truth(stage.rig), model(found.rig);
  const Vec3 e = stage.eye_mm, f = found.viewpoints[0].eye_mm;
  double worst = 0.0;
  for (int y = 0; y <= 2160; y += 216)
    for (int x = 0; x <= 3840; x += 240)
      worst = std::max(worst, std::abs(without_lenses(model.phase(x, y, 1, {f.x, f.y, f.z}) -
                                                      truth.phase(x, y, 1, {e.x, e.y, e.z}))));
  return worst;
}

void expect_found(const Calibration& found, const PhotoStage& stage, double pitch_error,
                  double slant_error, double phase_error) {
  ASSERT_EQ(found.verdict, Verdict::Effective) << found.reasons.at(0);
  const Viewpoint& v = found.viewpoints.at(0);
  const double pitch =
      stage.rig.sheet.pitch.value * (1.0 + stage.rig.sheet.gap.value / stage.eye_mm.z);
  EXPECT_NEAR(v.effective_pitch_subpx.value / pitch, 1.0, pitch_error);
  EXPECT_NEAR(v.slant.value, stage.rig.sheet.slant, slant_error);
  EXPECT_LT(worst_phase(found, stage), phase_error);
}

TEST(SinglePhoto, FindsPitchSlantAndOffset) {
  const PhotoStage s = stage();
  const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart, tape(s));
  expect_found(found, s, 2e-6, 5e-6, 0.005);
  const Viewpoint& v = found.viewpoints.at(0);
  EXPECT_NEAR(v.eye_mm.x, s.eye_mm.x, 2.0);
  EXPECT_NEAR(v.eye_mm.y, s.eye_mm.y, 2.0);
  EXPECT_NEAR(v.eye_mm.z, s.eye_mm.z, 5.0);
  const optics::OpticalModel truth(s.rig);
  EXPECT_NEAR(without_lenses(v.effective_offset_lenses.value -
                             truth.phase(1920.0, 1080.0, 1, {20.0, -15.0, 700.0})),
              0.0, 0.005);
  EXPECT_GT(v.contrast, 0.5);
  EXPECT_EQ(v.residual.values.size(), static_cast<size_t>(v.residual.columns * v.residual.rows));
  EXPECT_GT(v.covered, 0.9);
  EXPECT_FALSE(optics::find_problem(found.rig));
}

// Whoever has no tape gets less, and is told how much less.
TEST(SinglePhoto, ADistanceThatIsNotKnownIsInTheErrors) {
  const PhotoStage s = stage();
  const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart);
  expect_found(found, s, 1e-5, 5e-6, 0.02);
  const Viewpoint& v = found.viewpoints.at(0);
  const double pitch = s.rig.sheet.pitch.value * (1.0 + s.rig.sheet.gap.value / s.eye_mm.z);
  EXPECT_GT(v.eye_sigma_mm.z, 20.0);
  EXPECT_GT(v.effective_pitch_subpx.sigma / pitch, 5e-6);
  EXPECT_LT(std::abs(v.effective_pitch_subpx.value - pitch), 2.0 * v.effective_pitch_subpx.sigma);
  EXPECT_THAT(found.warnings, ::testing::Contains(HasSubstr("how far the camera was")));
}

TEST(SinglePhoto, FromTheSideTurnedAndThroughABentLens) {
  PhotoStage s = stage();
  s.eye_mm = {150.0, 40.0, 680.0};
  s.yaw_degrees = 12.0;
  s.roll_degrees = 5.0;
  s.distortion = 0.03;
  const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart, tape(s));
  expect_found(found, s, 4e-6, 1e-5, 0.01);
  EXPECT_NEAR(found.camera.k1, -0.03, 0.01);
}

TEST(SinglePhoto, APhoneMayBeHeldUpright) {
  PhotoStage s = stage();
  s.width = 720;
  s.height = 1024;
  s.roll_degrees = 90.0;
  const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart, tape(s));
  expect_found(found, s, 3e-6, 1e-5, 0.006);
}

TEST(SinglePhoto, BlurMakesTagsLargerAndNothingWorse) {
  PhotoStage s = stage();
  s.blur_px = 2;
  s.noise = 0.01;
  const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart, tape(s));
  expect_found(found, s, 4e-6, 1e-5, 0.01);
}

TEST(SinglePhoto, SaysWhyItRefuses) {
  PhotoStage s = stage();
  s.rays_per_side = 1;
  const auto reason = [&](const optics::Rig& rig) {
    s.rig = rig;
    const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart);
    EXPECT_EQ(found.verdict, Verdict::Refused);
    return found.reasons.empty() ? std::string("none") : found.reasons[0];
  };
  s.width = 320;
  s.height = 180;
  s.focal_px = 1120.0;  // the panel's middle only
  EXPECT_THAT(reason(desk_rig()), HasSubstr("of 9 tags were found"));
  s = stage();
  s.rays_per_side = 1;
  optics::Rig other = shown().chart.start;
  other.sheet.pitch.value *= 1.0001;
  EXPECT_THAT(
      fit_single_photo(photograph(s, shown().frame), plan_single_photo_chart(other)).reasons,
      ElementsAre(HasSubstr("drawn for another rig")));
  s.gain = 1.2;
  EXPECT_THAT(reason(desk_rig()), HasSubstr("clipped"));
  s.gain = 0.8;
  optics::Rig unfocused = desk_rig();
  unfocused.sheet.spot_sigma = Lenses(0.6);  // each lens shows the mean of what is under it
  EXPECT_THAT(reason(unfocused), HasSubstr("fringes"));
}

TEST(SinglePhoto, NoPictureIsTooStrange) {
  for (const float light : {0.0F, 0.5F, 1.0F, std::nanf(""), INFINITY, -1.0F}) {
    const CameraPicture picture{64, 64, 3, std::vector<float>(64 * 64 * 3, light), 0, {}};
    const Calibration found = fit_single_photo(picture, shown().chart);
    EXPECT_EQ(found.verdict, Verdict::Refused);
    EXPECT_EQ(found.rig, shown().chart.start);
  }
  EXPECT_EQ(fit_single_photo({0, 0, 1, {}, 0, {}}, shown().chart).verdict, Verdict::Refused);
}

}  // namespace
}  // namespace lenticule::calib
