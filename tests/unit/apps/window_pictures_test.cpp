// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "apps/lenticule-window/eye_pictures.h"
#include "optics/eye_simulator.h"
#include "tests/support/noise_frame.h"
#include "tests/support/random_rigs.h"
#include "tests/support/turned_picture.h"

namespace lenticule::window {
namespace {

optics::Rig small_rig() {
  optics::Rig rig = test::kiosk_rig();
  rig.panel.width_px = 96;
  rig.panel.height_px = 54;
  return rig;
}

optics::RgbPicture seen_by(const optics::OpticalModel& model, const frames::WovenFrame& woven,
                           const optics::Eye& eye, optics::PixelGrid size) {
  return optics::simulate_eye(model,
                              {.pixels = woven.bytes().data(),
                               .width = woven.width(),
                               .height = woven.height(),
                               .stride_bytes = woven.geometry().row_bytes()},
                              eye, {.width = size.width, .height = size.height});
}

const uint8_t* pixel(const optics::RgbPicture& picture, int i, int j) {
  return picture.pixels.data() + 3 * (static_cast<ptrdiff_t>(j) * picture.width + i);
}

TEST(EyePair, BeginsInTheMiddleOfTheViewingLine) {
  const EyePair eyes{optics::OpticalModel(small_rig())};
  EXPECT_EQ(eyes.left().x, -32.5);
  EXPECT_EQ(eyes.right().x, 32.5);
  EXPECT_EQ(eyes.left().z_mm, 700.0);
}

TEST(EyePair, CrossesTwoViewingZonesWithTheMouse) {
  const optics::OpticalModel model(small_rig());
  EyePair eyes(model);
  eyes.follow_mouse(0.0, 0.5);
  EXPECT_NEAR(eyes.middle().x, -model.lobe_width_mm(700.0), 1e-9);
  eyes.follow_mouse(1.0, 0.0);
  EXPECT_NEAR(eyes.middle().x, model.lobe_width_mm(700.0), 1e-9);
  EXPECT_NEAR(eyes.middle().y, 27.0 * 0.15567, 1e-9) << "the window's top is the panel's";
}

TEST(EyePair, StaysInFrontOfThePanelAndReturns) {
  EyePair eyes{optics::OpticalModel(small_rig())};
  eyes.step_back(-1000.0);
  EXPECT_NEAR(eyes.middle().z_mm, 140.0, 1e-9);
  eyes.step_back(1000.0);
  EXPECT_NEAR(eyes.middle().z_mm, 3500.0, 1e-9);
  eyes.centre();
  EXPECT_EQ(eyes.middle().z_mm, 700.0);
}

TEST(EyePair, HasADistanceForRigsWithoutOne) {
  const EyePair eyes{optics::OpticalModel(test::upright_rig())};
  EXPECT_EQ(eyes.middle().z_mm, 2.0 * 512 * 0.25);
}

TEST(WindowPicture, HasTheLeftEyeOnTheLeft) {
  const optics::OpticalModel model(small_rig());
  const frames::WovenFrame woven = test::noise_frame(96, 54, 3);
  const EyePair eyes(model);
  const optics::PixelGrid window{100, 40};
  const optics::PixelGrid size = eye_size(model.rig().panel, Look::SideBySide, window);
  EXPECT_EQ(size, (optics::PixelGrid{50, 28}));
  const frames::WovenFrame picture = window_picture(model, woven, eyes, Look::SideBySide, window);
  const optics::RgbPicture left = seen_by(model, woven, eyes.left(), size);
  const optics::RgbPicture right = seen_by(model, woven, eyes.right(), size);
  for (int j = 0; j < size.height; ++j)
    for (int i = 0; i < size.width; ++i)
      for (int c = 0; c < 3; ++c) {
        ASSERT_EQ(picture.row(6 + j)[3 * i + c], pixel(left, i, j)[c]);
        ASSERT_EQ(picture.row(6 + j)[3 * (50 + i) + c], pixel(right, i, j)[c]);
      }
  EXPECT_EQ(picture.row(5)[0] + picture.row(34)[0], 0) << "black above and below";
}

TEST(WindowPicture, OfAnAnaglyphIsRedForTheLeftEye) {
  const optics::OpticalModel model(small_rig());
  const frames::WovenFrame woven = test::noise_frame(96, 54, 4);
  const EyePair eyes(model);
  const optics::PixelGrid window{96, 60};
  const optics::PixelGrid size = eye_size(model.rig().panel, Look::Anaglyph, window);
  EXPECT_EQ(size, (optics::PixelGrid{96, 54}));
  const frames::WovenFrame picture = window_picture(model, woven, eyes, Look::Anaglyph, window);
  const optics::RgbPicture left = seen_by(model, woven, eyes.left(), size);
  const optics::RgbPicture right = seen_by(model, woven, eyes.right(), size);
  for (int i = 0; i < size.width; ++i) {
    EXPECT_EQ(picture.row(23)[3 * i], pixel(left, i, 20)[0]);
    EXPECT_EQ(picture.row(23)[3 * i + 1], pixel(right, i, 20)[1]);
    EXPECT_EQ(picture.row(23)[3 * i + 2], pixel(right, i, 20)[2]);
  }
}

TEST(WindowPicture, FitsIntoWindowsOfOnePixel) {
  const optics::Panel panel = small_rig().panel;
  for (const Look look : {Look::SideBySide, Look::Anaglyph})
    for (const optics::PixelGrid window : {optics::PixelGrid{1, 1}, {2, 900}, {900, 1}}) {
      const optics::PixelGrid size = eye_size(panel, look, window);
      EXPECT_GE(size.width, 1);
      EXPECT_GE(size.height, 1);
      EXPECT_LE(size.height, window.height);
    }
}

TEST(SeenFrame, TurnsTheSentPictureAsTheViewerSeesIt) {
  const frames::WovenFrame sent = test::noise_frame(7, 4, 5);
  std::vector<uint32_t> words;
  for (size_t n = 0; n < sent.bytes().size(); n += 3)
    words.push_back(uint32_t{sent.bytes()[n]} << 16 | uint32_t{sent.bytes()[n + 1]} << 8 |
                    uint32_t{sent.bytes()[n + 2]});
  for (const char* mounting : test::kMountingNames) {
    const frames::WovenFrame wanted = test::seen_of(sent, mounting);
    optics::Panel panel;
    panel.width_px = wanted.width();
    panel.height_px = wanted.height();
    panel.mounting = optics::mounting_named(mounting);
    EXPECT_EQ(seen_frame(words, panel), wanted) << mounting;
  }
}

}  // namespace
}  // namespace lenticule::window
