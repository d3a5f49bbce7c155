// SPDX-License-Identifier: Apache-2.0
// Tests the measuring model against the optical model that everything else uses.
#include "calib/fit/projection.h"

#include <gtest/gtest.h>

#include <random>

#include "calib/fit/observations.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

optics::Rig rig_with_map() {
  optics::Rig rig;
  rig.panel.width_px = 3840;
  rig.panel.height_px = 2160;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.1557);
  rig.sheet.pitch = Subpixels(7.701);
  rig.sheet.slant = 0.2521;
  rig.sheet.offset = Lenses(0.2);
  rig.sheet.gap = Millimetres(2.2);
  rig.sheet.refraction_shape = 0.45;
  rig.viewing.distance = Millimetres(700.0);
  return rig;
}

TEST(Projection, PhasesAgreeWithTheOpticalModel) {
  const optics::Rig rig = rig_with_map();
  const optics::OpticalModel model(rig);
  const SheetParameters sheet = sheet_start(rig).values;
  std::mt19937 random(9);
  std::uniform_real_distribution<double> share(-1.0, 1.0);
  for (int n = 0; n < 300; ++n) {
    const PoseValues pose{
        0, 0, 0, 300 * share(random), 200 * share(random), 700 + 200 * share(random)};
    const PlanePoint<double> lens{290 * share(random), 160 * share(random)};
    const PlanePoint<double> q = panel_point(pose.data(), sheet.data(), lens);
    const double phase = model.phase(rig.panel.x_px(q.x), rig.panel.y_px(q.y), 1,
                                     {pose[kPupil], pose[kPupil + 1], pose[kPupil + 2]});
    ASSERT_NEAR(lens_coordinate(sheet.data(), rig.panel, lens), phase, 1e-9);
  }
}

TEST(Projection, DistortionIsInverted) {
  const CameraValues camera = {1400.0, 970.0, 530.0, -0.05, 0.02};
  for (double x = -0.5; x <= 0.5; x += 0.1)
    for (double y = -0.3; y <= 0.3; y += 0.1) {
      const double r2 = x * x + y * y;
      const double factor = 1.0 + r2 * (camera[kRadial1] + camera[kRadial2] * r2);
      const PlanePoint<double> back =
          undistorted(camera.data(), 970.0 + 1400.0 * x * factor, 530.0 + 1400.0 * y * factor);
      ASSERT_NEAR(back.x, x, 1e-9);
      ASSERT_NEAR(back.y, y, 1e-9);
    }
}

TEST(Projection, AStraightCameraLooksStraight) {
  const CameraValues camera = {1000.0, 500.0, 300.0, 0.0, 0.0};
  // Half a turn about x: y down and z toward the panel.
  const PoseValues pose = {std::numbers::pi, 0, 0, 10.0, 20.0, 700.0};
  const PlanePoint<double> middle = lens_plane_point(camera.data(), pose.data(), 500.0, 300.0);
  EXPECT_NEAR(middle.x, 10.0, 1e-9);
  EXPECT_NEAR(middle.y, 20.0, 1e-9);
  const PlanePoint<double> right = lens_plane_point(camera.data(), pose.data(), 600.0, 350.0);
  EXPECT_NEAR(right.x, 10.0 + 70.0, 1e-9);
  EXPECT_NEAR(right.y, 20.0 - 35.0, 1e-9);
}

TEST(Observations, ConvertSheetsToParametersAndBack) {
  const optics::Rig rig = rig_with_map();
  optics::LensSheet back;
  set_sheet(sheet_start(rig).values, {}, {}, rig.panel, back);
  EXPECT_NEAR(back.pitch.value, rig.sheet.pitch.value, 1e-12);
  EXPECT_NEAR(back.slant, rig.sheet.slant, 1e-14);
  EXPECT_NEAR(back.offset.value, rig.sheet.offset.value, 1e-12);
  EXPECT_NEAR(back.gap.value, rig.sheet.gap.value, 1e-12);
}

}  // namespace
}  // namespace lenticule::calib
