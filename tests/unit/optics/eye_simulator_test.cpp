// SPDX-License-Identifier: Apache-2.0
#include "optics/eye_simulator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Frame {
  explicit Frame(const Panel& panel)
      : width(panel.width_px),
        height(panel.height_px),
        pixels(3 * static_cast<size_t>(width) * static_cast<size_t>(height)) {}

  uint8_t& at(int i, int j, int c) {
    return pixels[3 * (static_cast<size_t>(j) * static_cast<size_t>(width) +
                       static_cast<size_t>(i)) +
                  static_cast<size_t>(c)];
  }
  [[nodiscard]] RgbView view() const {
    return {pixels.data(), width, height, 3 * static_cast<size_t>(width)};
  }
  int width;
  int height;
  std::vector<uint8_t> pixels;
};

uint8_t pixel(const RgbPicture& picture, int u, int v, int c) {
  return picture.pixels[static_cast<size_t>(3 * (v * picture.width + u) + c)];
}

TEST(EyePicture, IsHalfThePanelsSizeByDefault) {
  const OpticalModel model(test::upright_rig());
  const Frame frame(model.rig().panel);
  const RgbPicture half = simulate_eye(model, frame.view(), {0, 0, kInfinity});
  EXPECT_EQ(half.width, 256);
  EXPECT_EQ(half.height, 48);
  const RgbPicture sized =
      simulate_eye(model, frame.view(), {0, 0, kInfinity}, {.width = 7, .height = 5});
  EXPECT_EQ(sized.pixels.size(), 7u * 5u * 3u);
}

TEST(EyePicture, ShowsEachCornerOfTheFrameInItsCorner) {
  // Red top left, green top right, blue bottom left, white bottom right.
  const OpticalModel model(test::kiosk_rig());
  Frame frame(model.rig().panel);
  for (int j = 0; j < frame.height; ++j) {
    for (int i = 0; i < frame.width; ++i) {
      const bool right = i >= frame.width / 2, bottom = j >= frame.height / 2;
      frame.at(i, j, 0) = right == bottom ? 200 : 0;
      frame.at(i, j, 1) = right ? 200 : 0;
      frame.at(i, j, 2) = bottom ? 200 : 0;
    }
  }
  const RgbPicture seen =
      simulate_eye(model, frame.view(), {0, 0, 700}, {.width = 64, .height = 36});
  const auto is = [&](int u, int v, int r, int g, int b) {
    return pixel(seen, u, v, 0) == r && pixel(seen, u, v, 1) == g && pixel(seen, u, v, 2) == b;
  };
  EXPECT_TRUE(is(1, 1, 200, 0, 0));
  EXPECT_TRUE(is(62, 1, 0, 200, 0));
  EXPECT_TRUE(is(1, 34, 0, 0, 200));
  EXPECT_TRUE(is(62, 34, 200, 200, 200));
}

TEST(EyePicture, KeepsEveryGreyLevelOfAFlatFrame) {
  const OpticalModel model(test::upright_rig());
  Frame frame(model.rig().panel);
  for (int code = 1; code < 256; code += 6) {
    std::fill(frame.pixels.begin(), frame.pixels.end(), static_cast<uint8_t>(code));
    const RgbPicture seen =
        simulate_eye(model, frame.view(), {0.02, 0, kInfinity}, {.width = 16, .height = 3});
    for (const uint8_t shown : seen.pixels) ASSERT_EQ(shown, code);
  }
}

TEST(EyePicture, MixesInLinearLight) {
  // An eye between two views with a wide spot: equal parts of black and white are half the light,
  // which is code 188, not 128.
  Rig rig = test::upright_rig();
  rig.sheet.spot_sigma = Lenses(0.3);
  const OpticalModel model(rig);
  Frame frame(rig.panel);
  for (int j = 0; j < frame.height; ++j) {
    for (int i = 0; i < frame.width; i += 2) {
      for (int c = 0; c < 3; ++c) frame.at(i, j, c) = 255;
    }
  }
  const RgbPicture seen =
      simulate_eye(model, frame.view(), {0, 0, kInfinity}, {.width = 16, .height = 3});
  EXPECT_NEAR(pixel(seen, 8, 1, 1), 188, 3);
}

TEST(EyePicture, IsBlackWhereTheEyeLooksPastThePanel) {
  const OpticalModel model(test::upright_rig());
  Frame frame(model.rig().panel);
  std::fill(frame.pixels.begin(), frame.pixels.end(), uint8_t{200});
  // Far to the right, where the left lenses show the area left of the panel.
  const RgbPicture seen = simulate_eye(model, frame.view(), {1.0, 0, kInfinity});
  EXPECT_EQ(pixel(seen, 0, 20, 1), 0);
  EXPECT_EQ(pixel(seen, 255, 20, 1), 200);
}

TEST(EyePicture, RefusesAFrameOfAnotherPanel) {
  const OpticalModel model(test::upright_rig());
  const Frame frame(test::kiosk_rig().panel);
  EXPECT_THROW((void)simulate_eye(model, frame.view(), {0, 0, 500}), Error);
}

TEST(EyePicture, RefusesEyesThatAreNotInFrontOfThePanel) {
  const OpticalModel model(test::upright_rig());
  const Frame frame(model.rig().panel);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Eye& eye :
       {Eye{0, 0, 0}, Eye{0, 0, -700}, Eye{nan, 0, 700}, Eye{0, kInfinity, 700}, Eye{0, 0, nan}}) {
    EXPECT_THROW((void)simulate_eye(model, frame.view(), eye), Error);
  }
  EXPECT_THROW((void)simulate_eye(model, frame.view(), {0, 0, 500}, {.width = -1}), Error);
  EXPECT_THROW((void)simulate_eye(model, frame.view(), {0, 0, 500}, {.width = 1 << 20}), Error);
}

}  // namespace
}  // namespace lenticule::optics
