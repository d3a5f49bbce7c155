// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "frames/weaving/reweave.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;

ViewSet coded_views(int count, int width, int height) {
  std::vector<WovenFrame> views;
  for (int view = 0; view < count; ++view) {
    views.emplace_back(FrameGeometry{.width = width, .height = height});
    for (uint8_t& byte : views.back().bytes()) byte = static_cast<uint8_t>(view + 1);
    views.back().row(0)[0] = static_cast<uint8_t>(200 - view);  // marks the top row
  }
  return ViewSet(std::move(views), 0.75);
}

TEST(QuiltFile, IsReadBackAsTheSameViewsForAnyViewCount) {
  const test::ScratchFolder folder;
  for (const int count : {1, 2, 7, 45, 48}) {
    const ViewSet views = coded_views(count, 5, 7);
    const auto file = write_quilt(views, folder.path() / ("q" + std::to_string(count) + ".png"));
    auto layout = quilt_layout_of_name(file);
    ASSERT_TRUE(layout.has_value()) << file;
    EXPECT_DOUBLE_EQ(layout->aspect.value_or(0.0), 0.75);
    layout->views = count;  // a name does not state how many tiles are in use
    const ViewSet back(read_woven(file), *layout);
    ASSERT_EQ(back.width(), 5);
    ASSERT_EQ(back.height(), 7);
    for (int view = 0; view < count; ++view)
      for (int row = 0; row < 7; ++row)
        for (int column = 0; column < 5; ++column)
          for (int c = 0; c < 3; ++c)
            ASSERT_EQ(back.pixel(view, column, row)[c], views.pixel(view, column, row)[c])
                << count << " views, view " << view;
  }
}

TEST(QuiltFile, PutsTheLeftmostViewAtTheBottomLeft) {
  const WovenFrame quilt = draw_quilt(coded_views(5, 2, 2), {.columns = 3, .rows = 2, .views = 5});
  EXPECT_EQ(quilt.row(3)[0], 1);
  EXPECT_EQ(quilt.row(3)[4 * 3], 3);
  EXPECT_EQ(quilt.row(1)[0], 4);
  EXPECT_EQ(quilt.row(1)[4 * 3], 0) << "the last tile is unused";
}

TEST(QuiltFile, NamesStateTheLayout) {
  const QuiltLayout layout{.columns = 8, .rows = 6, .views = 0, .aspect = 0.75};
  EXPECT_EQ(quilt_name("a/city.png", layout), "a/city_qs8x6a0.75.png");
  EXPECT_EQ(quilt_name("a/city_qs8x6a0.75.png", layout), "a/city_qs8x6a0.75.png");
  EXPECT_EQ(quilt_name("a/city_qs8x6.png", layout), "a/city_qs8x6.png");
  EXPECT_EQ(error_of([&] { (void)quilt_name("city_qs9x5a0.75.png", layout); }).kind(),
            ErrorKind::Usage);
  EXPECT_EQ(error_of([&] { (void)draw_quilt(coded_views(5, 2, 2), layout); }).kind(),
            ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::frames
