// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/phone_photo.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "frames/image_io.h"
#include "lab/phone/workshop.h"
#include "optics/model.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::lab {
namespace {

constexpr int kGreen = 1;

Workshop small_workshop(uint64_t seed) {
  WorkshopLimits limits;
  limits.panel_width = 960;
  limits.diagonal_inches = 12.0;
  limits.phone_width = 640;
  return draw_workshop(seed, limits);
}

frames::WovenFrame flat_frame(const optics::Panel& panel, uint8_t code) {
  frames::WovenFrame frame({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  std::ranges::fill(frame.bytes(), code);
  return frame;
}

/// Returns the mean code of a rectangle in the middle of the photograph.
double middle_code(const Photo& photo) {
  double sum = 0.0;
  int count = 0;
  for (int j = photo.height * 2 / 5; j < photo.height * 3 / 5; ++j)
    for (int i = photo.width * 2 / 5; i < photo.width * 3 / 5; ++i, ++count)
      sum += photo.codes[3 * (static_cast<size_t>(j) * static_cast<size_t>(photo.width) +
                              static_cast<size_t>(i)) +
                         kGreen];
  return sum / count;
}

// Straight through an apex, the traced ray obeys the law of a plane slab.
TEST(PhoneBench, ARayThroughAnApexObeysSnellsLaw) {
  const Workshop workshop = small_workshop(1);
  SheetBuild build = workshop.build;
  build.glass_mm = 0.0;
  const LensSection sheet(build, workshop.start.panel);
  for (const double tangent : {-0.5, -0.1, 0.0, 0.3}) {
    const auto shift = sheet.trace(0.0, tangent, 0.0, kGreen);
    ASSERT_TRUE(shift);
    const double inside = std::asin(std::sin(std::atan(tangent)) / build.sheet_index);
    EXPECT_NEAR(shift->across, -build.sheet_mm * std::tan(inside), 1e-12);
  }
}

// All places under a lens send the eye to nearly the same point of the pixels.
TEST(PhoneBench, TheLensesFocusOnThePixels) {
  const Workshop workshop = small_workshop(2);
  SheetBuild build = workshop.build;
  build.defocus = 0.0;
  const LensSection sheet(build, workshop.start.panel);
  for (const double place : {-0.25, -0.1, 0.2}) {
    const auto shift = sheet.trace(place, 0.0, 0.0, kGreen);
    ASSERT_TRUE(shift);
    EXPECT_NEAR(place + shift->across / sheet.pitch_mm(), 0.0, 0.03);
  }
}

// An eye far to the side sees light of one lens on more than a lens width of subpixels, whose edge
// enters the neighbour. The middle of the light still moves smoothly with the direction.
TEST(PhoneBench, TheMiddleOfWideLightMovesSmoothly) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Workshop workshop = small_workshop(seed);
    SheetBuild build = workshop.build;
    build.sheet_index = 1.49;
    build.defocus = 0.08;
    const LensSection sheet(build, workshop.start.panel);
    const auto shift = [&](double tangent) {
      return sheet.mean_shift(tangent, 0.0, kGreen).across / sheet.pitch_mm();
    };
    for (double t = 0.9; t < 1.1; t += 0.01)
      EXPECT_NEAR(shift(t - 0.01) + shift(t + 0.01), 2.0 * shift(t), 0.008) << seed << " " << t;
  }
}

TEST(PhoneBench, BlueIsBentMoreThanRed) {
  const Workshop workshop = small_workshop(3);
  const LensSection sheet(workshop.build, workshop.start.panel);
  const double red = std::abs(sheet.trace(0.0, 0.3, 0.0, 0)->across);
  const double blue = std::abs(sheet.trace(0.0, 0.3, 0.0, 2)->across);
  EXPECT_LT(blue, red);
  EXPECT_GT(blue, 0.97 * red);
}

// The rig computed from the dimensions of a build agrees with what rays through whole lenses show.
TEST(PhoneBench, TheRigOfABuildHasThePhasesOfItsRays) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    WorkshopLimits limits;
    const Workshop workshop = draw_workshop(seed, limits);
    const LensSection sheet(workshop.build, workshop.start.panel);
    const optics::Rig rig = rig_of_build(sheet, workshop.start);
    // A rig has one gap and one shape; rays through whole lenses, up to 45 degrees at the corners
    // of the zone, do not obey them exactly.
    EXPECT_LT(worst_error(rig, sheet, judged_eyes(workshop.start)), 0.008) << "seed " << seed;
    const Vec3 middle{0.0, 0.0, workshop.start.viewing.distance.value};
    EXPECT_LT(worst_error(rig, sheet, {middle}), 0.005) << "seed " << seed;
    // The judge notices an offset.
    optics::Rig off = rig;
    off.sheet.offset = Lenses(rig.sheet.offset.value + 0.05);
    EXPECT_NEAR(worst_error(off, sheet, judged_eyes(workshop.start)), 0.05, 0.008);
  }
}

TEST(PhoneBench, EqualSeedsGiveEqualPhotographs) {
  const Workshop workshop = small_workshop(4);
  const LensSection sheet(workshop.build, workshop.start.panel);
  const frames::WovenFrame grey = flat_frame(workshop.start.panel, 128);
  const Photo a = photograph(sheet, grey.view(), workshop.phone, workshop.shots[0]);
  const Photo b = photograph(sheet, grey.view(), workshop.phone, workshop.shots[0]);
  EXPECT_EQ(a.codes, b.codes);
  Shot other = workshop.shots[0];
  ++other.seed;
  EXPECT_NE(photograph(sheet, grey.view(), workshop.phone, other).codes, a.codes);
}

// One lit column of subpixels in each lens appears bright to the eye behind it, and dark half a
// lens to the side.
TEST(PhoneBench, AnEyeSeesTheSubpixelsThatThePhasesName) {
  Workshop workshop = small_workshop(5);
  workshop.build.deformation.fill(0.0);
  workshop.phone.tone_mapping = 0.0;
  const LensSection sheet(workshop.build, workshop.start.panel);
  const optics::Panel& panel = workshop.start.panel;
  const Shot& shot = workshop.shots[0];
  const optics::OpticalModel model(rig_of_build(sheet, workshop.start));
  double seen[2];
  for (const int half : {0, 1}) {
    frames::WovenFrame frame = flat_frame(panel, 0);
    for (int j = 0; j < panel.height_px; ++j)
      for (int i = 0; i < panel.width_px; ++i) {
        const Vec2 at = panel.subpixel_centre_px(i, j, kGreen);
        const double phase =
            model.phase(at.x, at.y, kGreen, {shot.eye_mm.x, shot.eye_mm.y, shot.eye_mm.z}) +
            0.5 * half;
        if (std::abs(phase - std::round(phase)) < 0.25)
          std::fill_n(frame.row(j) + 3 * static_cast<ptrdiff_t>(i), 3, uint8_t{255});
      }
    seen[half] = middle_code(photograph(sheet, frame.view(), workshop.phone, shot));
  }
  EXPECT_GT(seen[0], 3.0 * seen[1]);
}

TEST(PhoneBench, AFileKeepsTheCodesAndTheFocalLength) {
  const Workshop workshop = small_workshop(6);
  const LensSection sheet(workshop.build, workshop.start.panel);
  const frames::WovenFrame white = flat_frame(workshop.start.panel, 255);
  // The first shot is upside down, and a picture of views is rotated when it is read.
  Photo photo = photograph(sheet, white.view(), workshop.phone, workshop.shots[1]);
  ASSERT_EQ(photo.orientation, 1);
  const test::ScratchFolder folder;
  write_photo(photo, 95, folder / "a.jpg");
  round_trip(photo, 95);
  const frames::WovenFrame read = frames::read_woven(folder / "a.jpg", frames::PictureUse::Views);
  ASSERT_EQ(read.width(), photo.width);
  // Decoders may differ by a code.
  int most = 0;
  for (size_t k = 0; k < photo.codes.size(); ++k)
    most = std::max(most, std::abs(int{photo.codes[k]} - int{read.bytes()[k]}));
  EXPECT_LE(most, 2);
  EXPECT_NEAR(photo.stated_focal_35mm, 36.0 * workshop.phone.focal, 2.0);
}

}  // namespace
}  // namespace lenticule::lab
