// SPDX-License-Identifier: Apache-2.0
// Tests the model to first order, which is what users measure and other systems assume.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "optics/model.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

/// Returns a kiosk without refraction of oblique rays, for which the paraxial laws are exact.
Rig straight_kiosk() {
  Rig rig = test::kiosk_rig();
  rig.sheet.refraction_shape = 1.0;
  return rig;
}

double phase_at(const OpticalModel& model, double x_px, double y_px, const Eye& eye) {
  return model.phase(x_px, y_px, 1, eye);
}

TEST(EffectivePitch, IsThePitchTimesOnePlusGapOverDistance) {
  const OpticalModel model(straight_kiosk());
  const LensSheet& sheet = model.rig().sheet;
  const Eye eye{30.0, -20.0, 700.0};
  const double lenses = phase_at(model, 3000.0, 1080.0, eye) - phase_at(model, 1000.0, 1080.0, eye);
  const double effective_subpx = 3.0 * 2000.0 / lenses;
  EXPECT_NEAR(effective_subpx, sheet.pitch.value * (1.0 + sheet.gap.value / eye.z_mm), 1e-9);
}

TEST(Lobe, IsAsWideAsThePitchTimesDistanceOverGap) {
  const OpticalModel model(straight_kiosk());
  const double z = 700.0, lobe = model.lobe_width_mm(z);
  EXPECT_NEAR(lobe, 125.0, 0.05);
  // One lobe sideways the next lens shows the same subpixel: from the lens point the shift is
  // exact, from the panel point the distance is (Ez + g) / Ez times as far.
  const Vec2 lens_point{100.0, 50.0};
  const double moved = model.refraction_shift_mm(lens_point, {lobe, 0, z}).x -
                       model.refraction_shift_mm(lens_point, {0, 0, z}).x;
  EXPECT_NEAR(moved, model.pitch_mm(), 1e-12);
  const double gap = model.rig().sheet.gap.value;
  const double phases = phase_at(model, 700.0, 300.0, {lobe * (z + gap) / z, 0, z}) -
                        phase_at(model, 700.0, 300.0, {0, 0, z});
  EXPECT_NEAR(phases, 1.0, 1e-10);
}

TEST(VerticalEyeMotion, ChangesThePhaseByTheSlantTimesHorizontalMotion) {
  for (const double slant : {0.2521, -0.5, 1.0}) {
    Rig rig = straight_kiosk();
    rig.sheet.slant = slant;
    const OpticalModel model(rig);
    const auto phase = [&](double ex, double ey) {
      return phase_at(model, 800.0, 1500.0, {ex, ey, 700.0});
    };
    const double per_x = (phase(1.0, 0.0) - phase(-1.0, 0.0)) / 2.0;
    const double per_y = (phase(0.0, 1.0) - phase(0.0, -1.0)) / 2.0;
    EXPECT_NEAR(per_y, -slant * per_x, 1e-11);
  }
}

TEST(DepthOfField, IsTheGapTimesTheSubpixelsPerLens) {
  const OpticalModel model(test::kiosk_rig());
  const double z = 700.0, subpixels_per_lens = model.rig().sheet.pitch.value;
  const double radians_per_subpixel = model.lobe_width_mm(z) / z / subpixels_per_lens;
  EXPECT_NEAR(model.depth_of_field_mm(), model.pitch_mm() / radians_per_subpixel, 1e-9);
}

TEST(RefractionShift, IsSnellsForOneSlab) {
  Rig rig = test::kiosk_rig();
  const double n = 1.5, thickness = 3.0;
  rig.sheet.gap = Millimetres(thickness / n);
  rig.sheet.refraction_shape = 1.0 / (n * n);
  const OpticalModel model(rig);
  for (const double degrees : {0.0, 10.0, 35.0, 60.0, 80.0}) {
    const double angle = degrees * std::numbers::pi / 180.0;
    const double inside = std::asin(std::sin(angle) / n);
    const Vec2 shift = model.refraction_shift_mm({0, 0}, {500.0 * std::tan(angle), 0.0, 500.0});
    EXPECT_NEAR(shift.x, thickness * std::tan(inside), 1e-12);
    EXPECT_EQ(shift.y, 0.0);
  }
}

TEST(LensPoint, IsWhereTheShiftLeadsBackToThePanelPoint) {
  std::mt19937_64 random(3);
  for (int r = 0; r < 300; ++r) {
    const OpticalModel model(test::random_rig(random));
    const Eye eye{100.0, -250.0, 400.0};
    const Vec2 q{37.0 + r, -80.0};
    const Vec2 l = model.lens_point_mm(q, eye);
    const Vec2 back = l - model.refraction_shift_mm(l, eye);
    ASSERT_NEAR(back.x, q.x, 1e-11);
    ASSERT_NEAR(back.y, q.y, 1e-11);
  }
}

TEST(Trim, OfPitchOrSlantKeepsThePanelsCentre) {
  std::mt19937_64 random(5);
  for (int r = 0; r < 100; ++r) {
    Rig rig = test::random_rig(random);
    rig.sheet.channel_offset = {};
    const OpticalModel before(rig);
    rig.sheet.pitch = rig.sheet.pitch * 1.0001;
    rig.sheet.slant += 1e-4;
    if (find_problem(rig)) continue;
    const OpticalModel after(rig);
    const double x = rig.panel.width_px / 2.0, y = rig.panel.height_px / 2.0;
    ASSERT_EQ(before.lens_coordinate(x, y, 1), after.lens_coordinate(x, y, 1));
  }
}

TEST(Slant, MirroredGivesAMirroredMap) {
  Rig rig = test::kiosk_rig();
  rig.viewing.height = Millimetres(40.0);
  const OpticalModel model(rig);
  rig.sheet.slant = -rig.sheet.slant;
  const OpticalModel mirrored(rig);
  const int w = rig.panel.width_px;
  std::mt19937_64 random(9);
  for (int n = 0; n < 3000; ++n) {
    const int i = static_cast<int>(random() % static_cast<uint64_t>(w));
    const int j = static_cast<int>(random() % 2160u), c = n % 3;
    const SubpixelRay ray = model.ray(i, j, c), other = mirrored.ray(w - 1 - i, j, 2 - c);
    if (std::abs(ray.place) > 0.5 - 1e-9) continue;
    ASSERT_EQ(other.lens, -ray.lens);
    ASSERT_NEAR(other.place, -ray.place, 1e-9);
    ASSERT_NEAR(other.lens_x_mm, -ray.lens_x_mm, 1e-9);
    ASSERT_NEAR(other.tan_x, -ray.tan_x, 1e-9);
    ASSERT_NEAR(other.tan_y, ray.tan_y, 1e-12);
  }
}

TEST(LensPhase, IsUnchangedByWholeLenses) {
  Rig rig = test::kiosk_rig();
  const OpticalModel model(rig);
  rig.sheet.offset = Lenses(rig.sheet.offset.value + 17.0);
  const OpticalModel moved(rig);
  for (int i = 0; i < 3840; i += 7) {
    const SubpixelRay a = model.ray(i, 1234, i % 3), b = moved.ray(i, 1234, i % 3);
    ASSERT_EQ(b.lens, a.lens + 17);
    ASSERT_NEAR(b.place, a.place, 1e-10);
    ASSERT_NEAR(b.tan_x, a.tan_x, 1e-12);
    ASSERT_NEAR(b.lens_x_mm, a.lens_x_mm, 1e-10);
  }
}

TEST(LensPhase, MovesByOneLensAfterOnePitch) {
  std::mt19937_64 random(21);
  for (int r = 0; r < 100; ++r) {
    Rig rig = test::random_rig(random);
    rig.sheet.residual = {};
    const OpticalModel model(rig);
    const double pitch_px = rig.sheet.pitch.value / 3.0;
    const double here = model.lens_coordinate(10.0, 20.0, 0);
    ASSERT_NEAR(model.lens_coordinate(10.0 + pitch_px, 20.0, 0), here + 1.0, 1e-9);
    // One row down the axes have moved left by the slant.
    ASSERT_NEAR(model.lens_coordinate(10.0 - rig.sheet.slant, 21.0, 0), here, 1e-9);
  }
}

/// Returns the vertical distance in pixels between the panel points of the full law and of the
/// paraxial one for a subpixel's lens point.
double bend_px(const OpticalModel& model, int i, int j) {
  const Panel& panel = model.rig().panel;
  const SubpixelRay ray = model.ray(i, j, 1);
  const double z = model.design_eye().z_mm;
  const Eye eye{ray.lens_x_mm + ray.tan_x * z, model.design_eye().y, z};
  const Vec2 q_px = panel.subpixel_centre_px(i, j, 1);
  const Vec2 full = model.lens_point_mm({panel.x_mm(q_px.x), panel.y_mm(q_px.y)}, eye);
  return (full.y - ray.lens_y_mm) / panel.pixel_height.value;
}

TEST(RowPlane, DiffersFromTheFullLawByAFractionOfAPixel) {
  // The vertical coordinate of a ray is the paraxial one, so that a row's rays lie in one plane.
  // The full law bends the top row of a 27-inch panel: 0.06 pixel in its middle, 0.16 more at its
  // ends (0.24 for the subpixel that is seen from the lobe's outer edge).
  const OpticalModel model(test::kiosk_rig());
  double middle = 0.0, end = 0.0, anywhere = 0.0;
  for (int i = 0; i < 3840; ++i) {
    const double bend = std::abs(bend_px(model, i, 0));
    if (std::abs(i - 1920) < 5) middle = std::max(middle, bend);
    if (std::abs(model.ray(i, 0, 1).place) < 0.05 && (i < 20 || i > 3820))
      end = std::max(end, bend);
    anywhere = std::max(anywhere, bend);
  }
  EXPECT_NEAR(middle, 0.055, 0.01);
  EXPECT_LT(end - middle, 0.2);
  EXPECT_LT(anywhere, 0.3);
  EXPECT_LT(std::abs(bend_px(model, 0, 1080)), 1e-3);  // zero at the eye's height
}

TEST(RowPlane, HoldsEveryRayOfARow) {
  Rig rig = test::kiosk_rig();
  rig.viewing.height = Millimetres(60.0);
  const OpticalModel model(rig);
  const SubpixelRay first = model.ray(0, 77, 0);
  for (int i = 0; i < 3840; i += 31) {
    const SubpixelRay ray = model.ray(i, 77, i % 3);
    ASSERT_EQ(ray.lens_y_mm, first.lens_y_mm);
    ASSERT_EQ(ray.tan_y, first.tan_y);
    ASSERT_NEAR(ray.lens_y_mm + ray.tan_y * 700.0, 60.0, 1e-10);
  }
}

}  // namespace
}  // namespace lenticule::optics
