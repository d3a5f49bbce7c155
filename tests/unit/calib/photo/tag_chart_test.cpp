// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/tag_chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

#include "frames/srgb.h"
#include "tests/support/error_matchers.h"
#include "tests/support/photo_stage.h"

namespace lenticule::calib {
namespace {

using test::desk_rig;

constexpr int kPixelsSeenAsOne = 3;

/// Returns the frame from so far away that three by three pixels blur into one.
PhotoLight as_seen_without_a_sheet(const frames::WovenFrame& frame) {
  constexpr int kSide = kPixelsSeenAsOne;
  PhotoLight picture{frame.width() / kSide, frame.height() / kSide, {}};
  for (int j = 0; j < picture.height; ++j) {
    for (int i = 0; i < picture.width; ++i) {
      double sum = 0.0;
      for (int k = 0; k < kSide * kSide; ++k)
        sum += frames::linear_of_codes()[frame.row(kSide * j +
                                                   k / kSide)[3 * (kSide * i + k % kSide)]];
      picture.light.push_back(static_cast<float>(sum / (kSide * kSide)));
    }
  }
  return picture;
}

const frames::WovenFrame& desk_frame() {
  static const frames::WovenFrame kFrame =
      draw_single_photo_chart(plan_single_photo_chart(desk_rig()));
  return kFrame;
}

TEST(TagChart, TagsAreFoundWhereTheyAreDrawn) {
  const SinglePhotoChart chart = plan_single_photo_chart(desk_rig());
  const auto tags = find_tags(as_seen_without_a_sheet(desk_frame()), 9);
  ASSERT_EQ(tags.size(), 9U);
  for (size_t t = 0; t < tags.size(); ++t) {
    const ChartTag* drawn = chart.tag(tags[t].id);
    ASSERT_NE(drawn, nullptr);
    const auto corners = drawn->corners_px();
    for (size_t i = 0; i < corners.size(); ++i) {
      EXPECT_NEAR(tags[t].corners_px[i].x, corners[i].x / kPixelsSeenAsOne, 0.3) << t;
      EXPECT_NEAR(tags[t].corners_px[i].y, corners[i].y / kPixelsSeenAsOne, 0.3) << t;
    }
  }
}

TEST(TagChart, AnotherRigHasOtherTags) {
  optics::Rig other = desk_rig();
  other.sheet.pitch.value *= 1.0001;
  const int id = plan_single_photo_chart(desk_rig()).tags[0].id;
  EXPECT_EQ(plan_single_photo_chart(desk_rig()).tags[0].id, id);
  EXPECT_NE(plan_single_photo_chart(other).tags[0].id, id);
  EXPECT_EQ(plan_single_photo_chart(other).tag(id), nullptr);
}

bool overlap(const ChartTag& a, const ChartTag& b) {
  const double size = 10.0 * std::max(a.cell_px, b.cell_px);
  return std::abs(a.left_px - b.left_px) < size && std::abs(a.top_px - b.top_px) < size;
}

TEST(TagChart, HasFiveLargerTagsWhereNineHaveNoRoom) {
  for (const auto& [width, height, pitch, count] :
       {std::tuple(3840, 2160, 20.0, 9), std::tuple(1920, 1080, 10.0, 9),
        std::tuple(1920, 1080, 12.0, 5), std::tuple(1366, 768, 5.0, 9),
        std::tuple(1366, 768, 12.0, 5), std::tuple(1280, 800, 5.0, 9),
        std::tuple(1280, 800, 12.0, 5)}) {
    optics::Rig rig = desk_rig();
    rig.panel.width_px = width;
    rig.panel.height_px = height;
    rig.sheet.pitch.value = pitch;
    ASSERT_TRUE(has_room_for_tags(rig)) << pitch;
    const SinglePhotoChart chart = plan_single_photo_chart(rig);
    EXPECT_EQ(chart.tags.size(), static_cast<size_t>(count)) << width << " " << pitch;
    for (const ChartTag& tag : chart.tags) {
      EXPECT_GE(tag.cell_px, (count == 9 ? 7.0 : 6.0) * pitch / 3.0);
      EXPECT_GE(std::min(tag.left_px, tag.top_px), 0.0);
      EXPECT_LE(tag.left_px + 10.0 * tag.cell_px, width);
      EXPECT_LE(tag.top_px + 10.0 * tag.cell_px, height);
      for (const ChartTag& other : chart.tags)
        EXPECT_TRUE(&other == &tag || !overlap(tag, other)) << width << " " << pitch;
      for (const ScalePatch& patch : chart.patches) {
        EXPECT_FALSE(tag.covers({patch.left_px, patch.top_px}, 0.0));
        EXPECT_FALSE(tag.covers({patch.left_px + 2.0 * patch.side_px, patch.top_px}, 0.0));
      }
    }
  }
}

TEST(TagChart, RefusesAPanelTooSmallForTags) {
  optics::Rig rig = desk_rig();
  rig.panel.width_px = 640;
  rig.panel.height_px = 360;
  rig.sheet.pitch.value = 14.0;
  test::expect_error(test::error_of([&] { (void)plan_single_photo_chart(rig); }), ErrorKind::Input,
                     "too few for five tags");
}

TEST(TagFinder, FindsTagsInNoise) {
  PhotoLight picture = as_seen_without_a_sheet(desk_frame());
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0.0F, 0.35F);
  for (float& light : picture.light) light += noise(random);
  EXPECT_GE(find_tags(picture, 9).size(), 8U);
}

TEST(TagFinder, FindsNothingWithoutTags) {
  EXPECT_TRUE(find_tags({0, 0, {}}, 9).empty());
  EXPECT_TRUE(find_tags({100, 100, std::vector<float>(10000, NAN)}, 9).empty());
  EXPECT_TRUE(find_tags({100, 100, std::vector<float>(10000, 0.0F)}, 9).empty());
}

}  // namespace
}  // namespace lenticule::calib
