// SPDX-License-Identifier: Apache-2.0
// Tests a single photograph with the simulated bench, whose rays are refracted by real cylinders
// and do not follow the fitted formulas.
#include <gtest/gtest.h>

#include <cmath>

#include "calib/photo/single_photo.h"
#include "lab/panel/simulated_bench.h"
#include "optics/model.h"
#include "tests/support/photo_stage.h"

namespace lenticule::calib {
namespace {

using lab::SimulatedBench;
using lab::SimulatedSheet;

constexpr Nanoseconds kLong = std::chrono::seconds(10);

SimulatedSheet bench_sheet() {
  SimulatedSheet sheet;
  sheet.pitch_subpx = 7.70123;
  sheet.slant = 0.2521;
  sheet.offset_lenses = 0.31;
  return sheet;
}

lab::SimulatedCamera bench_camera() {
  lab::SimulatedCamera camera;
  camera.width = 960;
  camera.height = 540;
  camera.centre_x_px = 480.0;
  camera.centre_y_px = 270.0;
  camera.focal_px = 975.0;
  camera.position_mm = {60.0, -25.0, 700.0};
  camera.samples = 6;
  camera.k1 = -0.02;
  camera.jpeg_quality = 90;
  return camera;
}

/// Returns the rig that a user assumes for that sheet.
optics::Rig believed(const SimulatedSheet& sheet) {
  optics::Rig rig = test::desk_rig();
  const lab::ChiefRay ray = chief_ray(sheet, 1);
  rig.sheet.gap = Millimetres(ray.gap_mm);
  rig.sheet.refraction_shape = ray.refraction_shape;
  rig.sheet.pitch = Subpixels(sheet.pitch_subpx * 1.004);
  rig.sheet.slant = sheet.slant - 0.004;
  rig.sheet.offset = Lenses(0.0);
  return rig;
}

Calibration calibrate(SimulatedBench& bench, const optics::Rig& start) {
  const SinglePhotoChart chart = plan_single_photo_chart(start);
  const frames::WovenFrame frame = draw_single_photo_chart(chart);
  EXPECT_EQ(bench.sink().show(frame.view(), kLong), frames::ShowResult::Shown);
  CameraPicture picture;
  for (int settle = 0; settle < 4; ++settle)
    EXPECT_EQ(bench.camera().grab(picture, kLong), GrabStatus::Ready);
  PhotoPriors tape;
  tape.distance_mm = Estimate{bench.ground_truth_camera().position_mm.z, 3.0};
  return fit_single_photo(picture, chart, tape);
}

/// Returns the largest phase error over the panel without its outermost twentieths, for the fitted
/// eye against the true eye.
double worst_phase(const Calibration& found, const SimulatedBench& bench) {
  const optics::OpticalModel model(found.rig);
  const Vec3 eye = found.viewpoints.at(0).eye_mm;
  double worst = 0.0;
  for (int r = 0; r < 10; ++r) {
    for (int c = 0; c < 16; ++c) {
      const double x = 240.0 * (c + 0.5), y = 216.0 * (r + 0.5);
      const double off = model.phase(x, y, 1, {eye.x, eye.y, eye.z}) -
                         bench.ground_truth_phase(x, y, 1, bench.ground_truth_camera().position_mm);
      worst = std::max(worst, std::abs(off - std::round(off)));
    }
  }
  return worst;
}

TEST(SinglePhotoOnTheBench, FindsRealLenses) {
  const SimulatedSheet sheet = bench_sheet();
  const optics::Rig start = believed(sheet);
  SimulatedBench bench(start.panel, sheet, {}, bench_camera(), 3);
  const Calibration found = calibrate(bench, start);
  ASSERT_EQ(found.verdict, Verdict::Effective) << found.reasons.at(0);
  EXPECT_LT(worst_phase(found, bench), 0.006);
  EXPECT_NEAR(found.viewpoints[0].slant.value, sheet.slant, 5e-6);
  EXPECT_NEAR(found.viewpoints[0].eye_mm.x, 60.0, 3.0);
  EXPECT_NEAR(found.viewpoints[0].eye_mm.y, -25.0, 3.0);
  EXPECT_NEAR(found.camera.k1, -0.02, 0.01);
}

TEST(SinglePhotoOnTheBench, MapsAnUnevenSheet) {
  SimulatedSheet sheet = bench_sheet();
  sheet.deformation_lenses = 0.1;
  const optics::Rig start = believed(sheet);
  SimulatedBench bench(start.panel, sheet, {}, bench_camera(), 3);
  const Calibration found = calibrate(bench, start);
  ASSERT_EQ(found.verdict, Verdict::Effective) << found.reasons.at(0);
  EXPECT_FALSE(found.rig.sheet.residual.empty());
  EXPECT_FALSE(optics::find_problem(found.rig));
  EXPECT_LT(worst_phase(found, bench), 0.05);  // worst in the corners, under the tags
}

TEST(SheetMap, EqualsTheSumOfItsPartsEverywhere) {
  optics::ResidualMap coarse{3, 2, {0.0, 0.1, 0.05, -0.1, 0.0, 0.2}};
  optics::ResidualMap fine{5, 4, {}};
  for (int i = 0; i < 20; ++i) fine.lenses.push_back(0.01 * std::sin(i));
  const optics::ResidualMap sum = sum_of_maps(coarse, fine);
  ASSERT_EQ(sum.columns, 5);
  ASSERT_EQ(sum.rows, 4);
  const optics::ResidualSpline a(coarse, 400, 300), b(fine, 400, 300), both(sum, 400, 300);
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 5; ++c)
      EXPECT_NEAR(both.at(100 * c, 100 * r).lenses,
                  a.at(100 * c, 100 * r).lenses + b.at(100 * c, 100 * r).lenses, 1e-12);
  EXPECT_EQ(sum_of_maps({}, fine), fine);
  EXPECT_EQ(sum_of_maps(fine, {}), fine);
}

}  // namespace
}  // namespace lenticule::calib
