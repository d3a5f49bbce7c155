// SPDX-License-Identifier: Apache-2.0
// Tests photographs of panels whose pitch, slant and offset differ from those of the chart.
#include "calib/photo/single_photo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "optics/model.h"
#include "tests/support/photo_stage.h"

namespace lenticule::calib {
namespace {

using test::desk_rig;
using test::photograph;
using test::PhotoStage;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// The chart of a rig whose pitch is 0.4 % off; drawn once for all tests.
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

/// Returns priors of a user who measures with a tape.
PhotoPriors tape(const PhotoStage& stage) {
  PhotoPriors priors;
  priors.distance_mm = Estimate{stage.eye_mm.z, 3.0};
  return priors;
}

double without_lenses(double phase) { return phase - std::round(phase); }

/// Returns the largest phase error over the panel, for the fitted eye against the ground truth.
double worst_phase(const Calibration& found, const PhotoStage& stage) {
  const optics::OpticalModel ground_truth(stage.rig), model(found.rig);
  const Vec3 e = stage.eye_mm, f = found.viewpoints[0].eye_mm;
  double worst = 0.0;
  for (int y = 0; y <= 2160; y += 216)
    for (int x = 0; x <= 3840; x += 240)
      worst =
          std::max(worst, std::abs(without_lenses(model.phase(x, y, 1, {f.x, f.y, f.z}) -
                                                  ground_truth.phase(x, y, 1, {e.x, e.y, e.z}))));
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
  const optics::OpticalModel ground_truth(s.rig);
  EXPECT_NEAR(without_lenses(v.effective_offset_lenses.value -
                             ground_truth.phase(1920.0, 1080.0, 1, {20.0, -15.0, 700.0})),
              0.0, 0.005);
  EXPECT_GT(v.contrast, 0.5);
  EXPECT_EQ(v.residual.values.size(), static_cast<size_t>(v.residual.columns * v.residual.rows));
  EXPECT_GT(v.covered, 0.9);
  EXPECT_FALSE(optics::find_problem(found.rig));
}

// The result is less accurate and states larger errors without a measured distance.
TEST(SinglePhoto, AnUnknownDistanceIncreasesTheStatedErrors) {
  const PhotoStage s = stage();
  const Calibration found = fit_single_photo(photograph(s, shown().frame), shown().chart);
  expect_found(found, s, 1e-5, 5e-6, 0.02);
  const Viewpoint& v = found.viewpoints.at(0);
  const double pitch = s.rig.sheet.pitch.value * (1.0 + s.rig.sheet.gap.value / s.eye_mm.z);
  EXPECT_GT(v.eye_sigma_mm.z, 20.0);
  EXPECT_GT(v.effective_pitch_subpx.sigma / pitch, 5e-6);
  EXPECT_LT(std::abs(v.effective_pitch_subpx.value - pitch), 2.0 * v.effective_pitch_subpx.sigma);
  EXPECT_THAT(found.warnings, ::testing::Contains(HasSubstr("the distance of the camera")));
}

TEST(SinglePhoto, ToleratesHowPhonesAreHeldAndWhatTheirPicturesLack) {
  struct Case {
    const char* what;
    std::function<void(PhotoStage&)> change;
    double pitch_error = 4e-6;
    double phase_error = 0.01;
  };
  const std::vector<Case> cases = {
      {"oblique, rotated and distorted",
       [](PhotoStage& s) {
         s.eye_mm = {150.0, 40.0, 680.0};
         s.yaw_degrees = 12.0;
         s.roll_degrees = 5.0;
         s.distortion = 0.03;
       }},
      {"upright",
       [](PhotoStage& s) {
         s.width = 720;
         s.height = 1024;
         s.roll_degrees = 90.0;
       },
       3e-6, 0.006},
      {"blurred",
       [](PhotoStage& s) {
         s.blur_px = 2;
         s.noise = 0.01;
       }},
      // Phones clip the middle of bright fringes, equally on both sides.
      {"clipped", [](PhotoStage& s) { s.gain = 1.3; }}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.what);
    PhotoStage s = stage();
    one.change(s);
    const Calibration found =
        fit_single_photo(photograph(s, shown().frame), shown().chart, tape(s));
    expect_found(found, s, one.pitch_error, 1e-5, one.phase_error);
    EXPECT_NEAR(found.camera.k1, -s.distortion, 0.01);
  }
}

TEST(SinglePhoto, RefusesWithAReason) {
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
  s.focal_px = 1120.0;  // light in the panel's middle only
  EXPECT_THAT(reason(desk_rig()), HasSubstr("of 9 tags were found"));
  s = stage();
  s.rays_per_side = 1;
  optics::Rig other = shown().chart.start;
  other.sheet.pitch.value *= 1.0001;
  EXPECT_THAT(
      fit_single_photo(photograph(s, shown().frame), plan_single_photo_chart(other)).reasons,
      ElementsAre(HasSubstr("made for another rig")));
  s.gain = 3.0;
  EXPECT_THAT(reason(desk_rig()), HasSubstr("clipped"));
  s.gain = 0.8;
  optics::Rig unfocused = desk_rig();
  unfocused.sheet.spot_sigma = Lenses(0.6);  // each lens shows the mean of the subpixels under it
  EXPECT_THAT(reason(unfocused), HasSubstr("fringes"));
}

/// Returns the largest phase error over the panel for an eye at the camera's true place.
double worst_placed(const Calibration& found, const PhotoStage& stage) {
  const optics::OpticalModel ground_truth(stage.rig), model(found.rig);
  const Vec3 e = stage.eye_mm;
  double worst = 0.0;
  for (int y = 0; y <= 2160; y += 216)
    for (int x = 0; x <= 3840; x += 240)
      worst = std::max(worst, std::abs(model.phase(x, y, 1, {e.x, e.y, e.z}) -
                                       ground_truth.phase(x, y, 1, {e.x, e.y, e.z})));
  return worst;
}

/// Returns worst_placed without whole lenses of the offset, which are invisible.
double placed_error(Calibration found, const PhotoStage& stage) {
  const optics::OpticalModel ground_truth(stage.rig), model(found.rig);
  const Vec3 e = stage.eye_mm;
  const double middle = model.phase(1920, 1080, 1, {e.x, e.y, e.z}) -
                        ground_truth.phase(1920, 1080, 1, {e.x, e.y, e.z});
  found.rig.sheet.offset.value -= std::round(middle);
  return worst_placed(found, stage);
}

/// Expects a refusal, or errors within the stated ones.
void expect_honest(const Calibration& found, const PhotoStage& stage, const std::string& what) {
  if (found.verdict == Verdict::Refused) return;
  EXPECT_LE(placed_error(found, stage), found.drift.worst_lenses) << what;
}

Calibration from_start(double pitch_factor, double slant_error, uint32_t seed) {
  optics::Rig start = desk_rig();
  start.sheet.pitch.value *= pitch_factor;
  start.sheet.slant += slant_error;
  const SinglePhotoChart chart = plan_single_photo_chart(start);
  PhotoStage s = stage();
  s.seed = seed;
  s.rays_per_side = 2;
  return fit_single_photo(photograph(s, draw_single_photo_chart(chart)), chart, tape(s));
}

// Covers the whole allowed range of starts, including those without visible fringes.
TEST(SinglePhoto, AFarStartIsCorrectedOrRefused) {
  uint32_t seed = 1;
  for (const double factor : {0.92, 0.96, 1.03, 1.08}) {
    const Calibration found = from_start(factor, 0.02, ++seed);
    ASSERT_EQ(found.verdict, Verdict::Effective) << factor << ' ' << found.reasons.at(0);
    EXPECT_LT(worst_phase(found, stage()), 0.03) << factor;
  }
  const Calibration too_far = from_start(1.2, 0.0, 9);
  EXPECT_EQ(too_far.verdict, Verdict::Refused);
}

TEST(SinglePhoto, RefusesAScaledChart) {
  PhotoStage s = stage();
  s.rays_per_side = 2;
  for (const double part : {0.95, 0.99}) {
    const Calibration found =
        fit_single_photo(photograph(s, test::scaled(shown().frame, part)), shown().chart, tape(s));
    EXPECT_EQ(found.verdict, Verdict::Refused) << part;
    EXPECT_THAT(found.reasons, ElementsAre(HasSubstr("scaled"))) << part;
  }
}

TEST(SinglePhoto, ErrorsOfTheInputAreWithinTheStatedError) {
  PhotoStage s = stage();
  s.rays_per_side = 2;
  for (const uint32_t seed : {1U, 2U}) {
    s.seed = seed;
    s.eye_mm = {seed == 1U ? 20.0 : -60.0, -15.0, 710.0};
    const CameraPicture picture = photograph(s, shown().frame);
    for (const double typed : {600.0, 710.0, 820.0}) {
      PhotoPriors priors;
      priors.distance_mm = Estimate{typed, 5.0};
      expect_honest(fit_single_photo(picture, shown().chart, priors), s,
                    "distance " + std::to_string(typed));
    }
    for (const double factor : {0.81, 1.0, 1.19}) {
      PhotoPriors priors;
      priors.focal_px = Estimate{factor * s.focal_px, 0.02 * s.focal_px};
      expect_honest(fit_single_photo(picture, shown().chart, priors), s,
                    "focal " + std::to_string(factor));
    }
  }
}

TEST(SinglePhoto, RefusesAContradictoryDistanceAndFocalLength) {
  const PhotoStage s = stage();
  const CameraPicture picture = photograph(s, shown().frame);
  PhotoPriors priors = tape(s);
  priors.focal_px = Estimate{s.focal_px, 0.02 * s.focal_px};
  EXPECT_EQ(fit_single_photo(picture, shown().chart, priors).verdict, Verdict::Effective);
  priors.distance_mm->value = 600.0;
  EXPECT_THAT(fit_single_photo(picture, shown().chart, priors).reasons,
              ElementsAre(HasSubstr("not 600 mm")));
}

TEST(SinglePhoto, RefusesAPanelSizeThatTheMeasuredDistanceContradicts) {
  PhotoStage s = stage();
  s.rays_per_side = 2;
  SinglePhotoChart believed = shown().chart;
  const CameraPicture picture = photograph(s, shown().frame);
  believed.start.panel.pixel_width.value *= 1.17;
  believed.start.panel.pixel_height.value *= 1.17;
  PhotoPriors priors = tape(s);
  expect_honest(fit_single_photo(picture, believed, priors), s, "size");
  priors.focal_px = Estimate{s.focal_px, 0.02 * s.focal_px};
  EXPECT_THAT(fit_single_photo(picture, believed, priors).reasons,
              ElementsAre(HasSubstr("the panel's size in the rig is wrong by 16 %")));
}

/// Returns the picture without columns at its left, so that the camera's axis is off the middle.
CameraPicture cut_at_the_left(const CameraPicture& whole, int columns) {
  CameraPicture cut = whole;
  cut.width = whole.width - columns;
  cut.light.clear();
  for (int j = 0; j < whole.height; ++j)
    for (int i = columns; i < whole.width; ++i)
      cut.light.push_back(whole.light[static_cast<size_t>(j) * static_cast<size_t>(whole.width) +
                                      static_cast<size_t>(i)]);
  return cut;
}

TEST(SinglePhoto, AnOffCentreCropIsRefusedOrWithinTheStatedError) {
  PhotoStage s = stage();
  s.rays_per_side = 2;
  s.focal_px = 780.0;
  for (const double yaw : {0.0, 10.0}) {
    s.yaw_degrees = yaw;
    const CameraPicture cropped = cut_at_the_left(photograph(s, shown().frame), 3 * s.width / 10);
    expect_honest(fit_single_photo(cropped, shown().chart, tape(s)), s,
                  "yaw " + std::to_string(yaw));
  }
}

// The axis of a phone is up to 0.8 % of the picture's width off the middle.
TEST(SinglePhoto, StatesWhatAnUnknownAxisCosts) {
  PhotoStage s = stage();
  s.rays_per_side = 2;
  const CameraPicture picture = cut_at_the_left(photograph(s, shown().frame), 12);
  const Calibration found = fit_single_photo(picture, shown().chart, tape(s));
  ASSERT_EQ(found.verdict, Verdict::Effective);
  EXPECT_GT(placed_error(found, s), 0.01);
  EXPECT_LT(placed_error(found, s), found.at_camera_lenses);
  EXPECT_LT(found.at_camera_lenses, 0.5 * found.drift.worst_lenses);
  EXPECT_THAT(found.warnings.back(), HasSubstr("since one photograph does not show the gap"));
}

TEST(SinglePhoto, SurvivesArbitraryPictures) {
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
