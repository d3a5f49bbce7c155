// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/phone_photo.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "frames/image_io.h"
#include "lab/phone/workshop.h"
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

// An eye far to the side sees light of one lens on more than a lens width of subpixels. The middle
// of the light still moves smoothly with the direction.
TEST(PhoneBench, TheMiddleOfWideLightMovesSmoothly) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Workshop workshop = small_workshop(seed);
    const SheetShape sheet(workshop.start.panel, workshop.build);
    const auto phase = [&](double tangent) {
      const Vec3 eye{500.0 * tangent, 0.0, 500.0};
      return true_view(sheet, {}, kGreen, eye, LightMiddle::Centroid)->phase;
    };
    for (double t = 0.9; t < 1.1; t += 0.01)
      EXPECT_NEAR(phase(t - 0.01) + phase(t + 0.01), 2.0 * phase(t), 0.008) << seed << " " << t;
  }
}

TEST(PhoneBench, EqualSeedsGiveEqualPhotographs) {
  const Workshop workshop = small_workshop(4);
  const SheetShape sheet(workshop.start.panel, workshop.build);
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
  workshop.phone.tone_mapping = 0.0;
  const SheetShape sheet(workshop.start.panel, workshop.build);
  const optics::Panel& panel = workshop.start.panel;
  const Shot& shot = workshop.shots[0];
  double seen[2];
  for (const int half : {0, 1}) {
    frames::WovenFrame frame = flat_frame(panel, 0);
    for (int j = panel.height_px / 4; j < panel.height_px * 3 / 4; ++j)
      for (int i = panel.width_px / 4; i < panel.width_px * 3 / 4; ++i) {
        const Vec2 at = panel.subpixel_centre_px(i, j, kGreen);
        const double phase = true_view(sheet, {panel.x_mm(at.x), panel.y_mm(at.y)}, kGreen,
                                       shot.eye_mm, LightMiddle::Centroid)
                                 ->phase +
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
  const SheetShape sheet(workshop.start.panel, workshop.build);
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
