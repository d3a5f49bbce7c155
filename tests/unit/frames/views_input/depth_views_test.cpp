// SPDX-License-Identifier: Apache-2.0
// Tests views made from a picture and its depth map against a plain reference implementation, and
// their visible properties: direction of motion, occlusion, filled holes.
#include "frames/views_input/depth_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/error_matchers.h"
#include "tests/support/oracles/depth_oracle.h"

namespace lenticule::frames {
namespace {

using test::error_of;

WovenFrame grey(int width, int height, uint8_t code) {
  WovenFrame picture({.width = width, .height = height});
  std::fill(picture.bytes().begin(), picture.bytes().end(), code);
  return picture;
}

void fill(WovenFrame& picture, int left, int right, uint8_t code) {
  for (int row = 0; row < picture.height(); ++row)
    std::fill(picture.row(row) + left * 3, picture.row(row) + right * 3, code);
}

/// Returns a depth map of plateaus, ramps and steps.
WovenFrame random_depth(int width, int height, std::mt19937& random) {
  WovenFrame depth({.width = width, .height = height});
  for (int row = 0; row < height; ++row) {
    double code = static_cast<double>(random() % 256), slope = 0.0;
    for (int i = 0; i < width; ++i) {
      if (random() % 7 == 0) code = static_cast<double>(random() % 256);
      if (random() % 5 == 0) slope = static_cast<double>(random() % 21) - 10.0;
      code = std::clamp(code + slope, 0.0, 255.0);
      std::fill_n(depth.row(row) + i * 3, 3, static_cast<uint8_t>(code));
    }
  }
  return depth;
}

test::DepthRow oracle_row(const WovenFrame& colour, const WovenFrame& depth, int row, double back,
                          double front) {
  test::DepthRow out;
  for (int i = 0; i < colour.width(); ++i) {
    const uint8_t* const rgb = colour.row(row) + i * 3;
    out.codes.push_back({rgb[0], rgb[1], rgb[2]});
    out.disparity.push_back(back + (front - back) * depth.row(row)[i * 3] / 255.0);
  }
  return out;
}

bool is_one_of(const std::vector<test::Colour>& allowed, const uint8_t* rgb) {
  for (const test::Colour& colour : allowed) {
    int most = 0;
    for (size_t c = 0; c < 3; ++c) most = std::max(most, std::abs(colour[c] - rgb[c]));
    if (most <= 1) return true;
  }
  return false;
}

TEST(DepthViews, AgreeWithTheReferenceForSurfacesStepsAndHoles) {
  std::mt19937 random(5);
  const int width = 40, height = 12;
  for (const auto& [views, back, front] :
       {std::tuple{5, -6.0, 7.3}, {2, 0.0, 12.0}, {4, 9.0, -9.0}, {7, -1.0, 1.0}}) {
    WovenFrame colour({.width = width, .height = height});
    for (uint8_t& byte : colour.bytes()) byte = static_cast<uint8_t>(random());
    const WovenFrame depth = random_depth(width, height, random);
    DepthViews drawn(
        width, height,
        {.views = views, .back = back, .front = front, .in_pixels = true, .threads = 2});
    const auto pictures = drawn.draw(window_of(colour.view()), window_of(depth.view()));
    for (int view = 0; view < views; ++view)
      for (int row = 0; row < height; ++row) {
        const test::DepthRow like = oracle_row(colour, depth, row, back, front);
        for (int k = 0; k < width; ++k)
          ASSERT_TRUE(is_one_of(test::depth_oracle(like, view, views, k),
                                pictures[static_cast<size_t>(view)].row(row) + k * 3))
              << "view " << view << " of " << views << ", row " << row << ", pixel " << k;
      }
  }
}

/// Returns the column where the white part of row 0 begins.
int white_begins(const FrameView& picture) {
  for (int i = 0; i < picture.geometry.width; ++i)
    if (picture.row(0)[i * 3] == 255) return i;
  return -1;
}

/// A white box at columns 20 to 24 of 48, over a black ground in the panel's plane.
struct Box {
  WovenFrame colour = grey(48, 2, 0);
  WovenFrame depth = grey(48, 2, 0);
  explicit Box(uint8_t code, uint8_t ground = 0) {
    fill(colour, 20, 24, 255);
    depth = grey(48, 2, ground);
    fill(depth, 20, 24, code);
  }
};

TEST(DepthViews, MoveNearObjectsLeftAndFarOnesRightAsTheEyeMovesRight) {
  const Box near(255);
  DepthViews before(48, 2, {.views = 3, .back = 0.0, .front = 8.0, .in_pixels = true});
  const auto in_front = before.draw(window_of(near.colour.view()), window_of(near.depth.view()));
  EXPECT_EQ(white_begins(in_front[0]), 24);
  EXPECT_EQ(white_begins(in_front[1]), 20);
  EXPECT_EQ(white_begins(in_front[2]), 16);

  const Box far(0, 255);
  DepthViews behind(48, 2, {.views = 3, .back = -8.0, .front = 0.0, .in_pixels = true});
  // The ground in the panel's plane hides a box behind it where the box moves under it.
  const auto far_away = behind.draw(window_of(far.colour.view()), window_of(far.depth.view()));
  EXPECT_EQ(white_begins(far_away[1]), 20);
  EXPECT_EQ(white_begins(far_away[0]), -1) << "hidden behind the ground left of its hole";
}

TEST(DepthViews, TheDisparityOfADistanceIsLinearInItsReciprocal) {
  // Distances from 1 to 3 give code 51 for 2.6: a share of (1/2.6 - 1/3) / (1 - 1/3) = 1/13.
  const Box box(51);
  DepthViews drawn(
      48, 2, {.views = 2, .back = 0.0, .front = 52.0, .in_pixels = true, .distance_ratio = 3.0});
  const auto views = drawn.draw(window_of(box.colour.view()), window_of(box.depth.view()));
  EXPECT_EQ(white_begins(views[0]), 22);
  EXPECT_EQ(white_begins(views[1]), 18);
}

TEST(DepthViews, TheZeroPlaneLiesInThePanelsPlane) {
  const Box near(255);
  for (const Disparity zero : {Disparity{8.0, true}, Disparity{8.0 / 48.0, false}}) {
    DepthViews drawn(
        48, 2, {.views = 2, .back = 0.0, .front = 8.0, .in_pixels = true, .zero_plane = zero});
    for (const FrameView& view :
         drawn.draw(window_of(near.colour.view()), window_of(near.depth.view())))
      EXPECT_EQ(white_begins(view), 20);
  }
}

TEST(DepthViews, ALimitCompressesDepthAndKeepsTheZeroPlane) {
  struct Case {
    double back, front, zero, most, limited_back, limited_front;
  };
  for (const Case& one : {Case{-4, 8, 0, 8, -4, 8},     // within the limit
                          Case{-4, 16, 0, 8, -3.2, 8},  // 4 / (1 + 4 (1/8 - 1/16))
                          Case{0, 16, 8, 4, -4, 4}})
    for (const bool is_near : {false, true}) {
      const Box box = is_near ? Box(255, 0) : Box(0, 255);
      const auto views_of = [&](const DepthOptions& options) {
        DepthViews drawn(48, 2, options);
        const auto views = drawn.draw(window_of(box.colour.view()), window_of(box.depth.view()));
        return std::vector<uint8_t>(views[0].bytes.begin(), views[0].bytes.end());
      };
      EXPECT_EQ(views_of({.views = 2,
                          .back = one.back,
                          .front = one.front,
                          .in_pixels = true,
                          .zero_plane = {one.zero, true},
                          .most = one.most / 48}),
                views_of({.views = 2,
                          .back = one.limited_back,
                          .front = one.limited_front,
                          .in_pixels = true}))
          << one.most;
    }
}

TEST(DepthViews, FillHolesFromTheFartherSide) {
  Box box(255);
  fill(box.colour, 0, 20, 60);
  fill(box.colour, 24, 48, 90);
  DepthViews drawn(48, 2, {.views = 2, .back = 0.0, .front = 8.0, .in_pixels = true});
  const auto views = drawn.draw(window_of(box.colour.view()), window_of(box.depth.view()));
  // The box is at 24 to 28 in the left view and uncovers 20 to 24.
  for (int i = 20; i < 24; ++i) EXPECT_NE(views[0].row(0)[i * 3], 255) << i;
  for (int i = 24; i < 28; ++i) EXPECT_EQ(views[0].row(0)[i * 3], 255) << i;
  for (int i = 16; i < 20; ++i) EXPECT_EQ(views[1].row(0)[i * 3], 255) << i;
  for (int i = 20; i < 24; ++i) EXPECT_NE(views[1].row(0)[i * 3], 255) << i;
}

TEST(DepthViews, ReproduceThePictureForDepthInThePanelsPlane) {
  std::mt19937 random(9);
  WovenFrame colour({.width = 31, .height = 9});
  for (uint8_t& byte : colour.bytes()) byte = static_cast<uint8_t>(random());
  const WovenFrame depth = grey(7, 3, 0);  // a wrong size
  DepthViews drawn(31, 9, {.views = 4, .back = 0.0, .front = 0.1});
  for (const FrameView& view : drawn.draw(window_of(colour.view()), window_of(depth.view())))
    EXPECT_TRUE(std::equal(view.bytes.begin(), view.bytes.end(), colour.bytes().begin()));
}

TEST(DepthViews, AcceptInvertedDepthAndRelativeRanges) {
  const Box white(255), black(0, 255);
  DepthViews pixels(48, 2, {.views = 2, .back = 0.0, .front = 6.0, .in_pixels = true});
  DepthViews widths(48, 2,
                    {.views = 2, .back = 0.0, .front = 0.125, .black_is_near = true, .threads = 2});
  const auto one = pixels.draw(window_of(white.colour.view()), window_of(white.depth.view()));
  const auto two = widths.draw(window_of(black.colour.view()), window_of(black.depth.view()));
  for (size_t view = 0; view < 2; ++view)
    EXPECT_TRUE(
        std::equal(one[view].bytes.begin(), one[view].bytes.end(), two[view].bytes.begin()));
}

TEST(DepthViews, RefuseInvalidInput) {
  const auto kind = [](const DepthOptions& options, int width = 8) {
    return error_of([&] { const DepthViews drawn(width, 4, options); }).kind();
  };
  EXPECT_EQ(kind({.views = 1}), ErrorKind::Usage);
  EXPECT_EQ(kind({.views = 100'000}), ErrorKind::Usage);
  EXPECT_EQ(kind({.front = std::nan("")}), ErrorKind::Usage);
  EXPECT_EQ(kind({.back = -3.0}), ErrorKind::Usage);
  EXPECT_EQ(kind({.views = 4000}, 32768 * 8), ErrorKind::Input);
}

}  // namespace
}  // namespace lenticule::frames
