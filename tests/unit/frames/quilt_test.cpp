// SPDX-License-Identifier: Apache-2.0
// Tests which tile belongs to which camera, for every grid of quilts.
#include "frames/quilt.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using ::testing::HasSubstr;

/// Returns a quilt in which every byte of a tile is the tile's index from the top-left corner.
WovenFrame counted_tiles(int columns, int rows, int tile_w, int tile_h) {
  WovenFrame quilt({.width = columns * tile_w, .height = rows * tile_h});
  for (int y = 0; y < quilt.height(); ++y)
    for (int x = 0; x < quilt.width() * 3; ++x)
      quilt.row(y)[x] = static_cast<uint8_t>(y / tile_h * columns + x / 3 / tile_w);
  return quilt;
}

TEST(QuiltName, IsColumnsRowsAspect) {
  EXPECT_EQ(quilt_layout_of_name("dir/city_qs8x6a0.75.png"),
            (QuiltLayout{.columns = 8, .rows = 6, .views = 0, .aspect = 0.75}));
  EXPECT_EQ(quilt_layout_of_name("a_qs5x9a1.77778.jpg")->aspect, 1.77778);
  EXPECT_EQ(quilt_layout_of_name("_qs1x23a2.png")->rows, 23);
  EXPECT_EQ(quilt_layout_of_name("a_qs5x9a1.6z1.2f0.1.png")->aspect, 1.6);
  EXPECT_EQ(quilt_layout_of_name("a_qs5x9a1e2.png")->aspect, 1.0) << "no exponents";
  EXPECT_EQ(quilt_layout_of_name("a_qs4x3.png"),
            (QuiltLayout{.columns = 4, .rows = 3, .views = 0, .aspect = std::nullopt}));
  EXPECT_EQ(quilt_layout_of_name("CITY_QS8X6A0.75.PNG")->rows, 6) << "capitals";
  EXPECT_EQ(quilt_layout_of_name("a_qs2x2a1_qs4x3a1.png")->columns, 4) << "the last one counts";
  EXPECT_EQ(quilt_layout_of_name("a_qs8x6v45a0.75.png"),
            (QuiltLayout{.columns = 8, .rows = 6, .views = 45, .aspect = 0.75}));
  for (const char* const name :
       {"qs8x6a0.75.png", "q qs8x6a0.75.png", "q_qs08x06a0.75.png", "q_qs8X6a0.75.png",
        "q_qs8x6a.75.png", "q_qs8x6a3:4.png", "q_qs8x6a0.75 (1).png", "q_qs8x6a0.75-loop.png",
        "q_qs8x6a0.75.q.png", "q_qs8x6a0.75_1.png", "q_qs8x6a0.75f0.2z1.png", "q_qs8x6a0.75_qs.png",
        "q_qs8x6a0.75_qs8.png"})
    EXPECT_EQ(quilt_layout_of_name(name),
              (QuiltLayout{.columns = 8, .rows = 6, .views = 0, .aspect = 0.75}))
        << name;
}

TEST(QuiltName, MayStateAZoom) {
  EXPECT_EQ(quilt_layout_of_name("a_qs5x9a1.77z1.2f0.0.jpg")->zoom, 1.2);
  EXPECT_EQ(quilt_layout_of_name("a_qs5x9f-0.5z1.5.jpg")->zoom, 1.5);
  for (const char* const name :
       {"a_qs5x9a1.6z1.png", "a_qs5x9zebra.png", "a_qs5x9z.png", "a_qs5x9znan.png"})
    EXPECT_EQ(quilt_layout_of_name(name)->zoom, 1.0) << name;
}

TEST(QuiltName, RefusesInvalidLayouts) {
  for (const char* name :
       {"a.png", "q_8x6_qs.png", "seqs8x6.png", "a_qs8x6v49.png", "a_qs8x6a3:0.png", "a_qs8.png",
        "a_qsx6a1.png", "a_qs0x6a1.png", "a_qs8x-6a1.png", "a_qs8x6a0.png", "a_qs8x6anan.png",
        "a_qs8x6a-1.png", "a_qs99999x99999a1.png", "a_qs99999999999x1a1.png", "a_qs8x6a1000.png",
        "a_qs8x6ainf.png", "a_qs", ""})
    EXPECT_FALSE(quilt_layout_of_name(name)) << name;
}

struct Grid {
  int columns, rows, views;
};
class QuiltGrid : public ::testing::TestWithParam<Grid> {};

TEST_P(QuiltGrid, CountsFromTheBottomLeftRightwardAndUpward) {
  const auto [columns, rows, views] = GetParam();
  const ViewSet set(counted_tiles(columns, rows, 3, 2),
                    {.columns = columns, .rows = rows, .views = views, .aspect = std::nullopt});
  ASSERT_EQ(set.count(), views == 0 ? columns * rows : views);
  for (int view = 0; view < set.count(); ++view) {
    const int from_top = (rows - 1 - view / columns) * columns + view % columns;
    for (const int y : {0, 1})
      for (const int x : {0, 2})
        for (const int c : {0, 1, 2})
          ASSERT_EQ(set.pixel(view, x, y)[c], from_top) << "view " << view;
  }
}
INSTANTIATE_TEST_SUITE_P(Grids, QuiltGrid,
                         ::testing::Values(Grid{1, 1, 0}, Grid{4, 3, 0}, Grid{3, 4, 0},
                                           Grid{1, 23, 0}, Grid{23, 1, 0}, Grid{5, 5, 23},
                                           Grid{4, 3, 9}, Grid{4, 3, 1}, Grid{8, 6, 48}));

TEST(Quilt, SurplusPixelsAreAtTheRightAndTheTop) {
  WovenFrame quilt({.width = 11, .height = 7});
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 33; ++x) quilt.row(y)[x] = static_cast<uint8_t>(10 * y + x / 3);
  const ViewSet set(quilt, {.columns = 3, .rows = 2, .views = 0, .aspect = std::nullopt});
  EXPECT_EQ(set.width(), 3);
  EXPECT_EQ(set.height(), 3);
  EXPECT_EQ(*set.pixel(0, 0, 2), 60) << "bottom-left corner of the picture";
  EXPECT_EQ(*set.pixel(5, 2, 0), 18) << "one unused row above, two columns beside";
}

TEST(Quilt, AspectComesFromTheNameOrTheTiles) {
  EXPECT_DOUBLE_EQ(ViewSet(counted_tiles(2, 2, 4, 3), {.columns = 2, .rows = 2}).aspect(), 4.0 / 3);
  EXPECT_DOUBLE_EQ(
      ViewSet(counted_tiles(2, 2, 4, 3), {.columns = 2, .rows = 2, .views = 0, .aspect = 1.5})
          .aspect(),
      1.5);
}

TEST(Quilt, InvalidLayoutsAreUsageErrors) {
  for (const QuiltLayout& layout :
       {QuiltLayout{.columns = 0, .rows = 1}, QuiltLayout{.columns = 1, .rows = -1},
        QuiltLayout{.columns = 65, .rows = 65}, QuiltLayout{.columns = 2, .rows = 2, .views = 5},
        QuiltLayout{.columns = 2, .rows = 2, .views = -1},
        QuiltLayout{.columns = 2, .rows = 2, .views = 4, .aspect = 0.0},
        QuiltLayout{.columns = 2, .rows = 2, .views = 4, .aspect = std::nan("")}})
    EXPECT_EQ(error_of([&] { ViewSet set(counted_tiles(2, 2, 2, 2), layout); }).kind(),
              ErrorKind::Usage);
}

TEST(Quilt, WithFewerPixelsThanTilesIsAnInputError) {
  const Error error =
      error_of([&] { ViewSet set(counted_tiles(2, 2, 2, 2), {.columns = 5, .rows = 1}, "q.png"); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), HasSubstr("q.png: 4 x 4 pixels are too few for 5 x 1 tiles"));
}

TEST(Views, ComeInTheOrderOfTheirNumbers) {
  const test::ScratchFolder folder;
  for (int n = 9; n < 12; ++n) {
    WovenFrame view({.width = 2, .height = 1});
    std::fill(view.bytes().begin(), view.bytes().end(), static_cast<uint8_t>(n));
    write_woven(view.view(), folder / (std::to_string(n) + ".png"));
  }
  const std::string pattern = (folder / "%d.png").string();
  const auto read = [&] { return read_views(list_frame_files(pattern), pattern); };
  const ViewSet set = read();
  ASSERT_EQ(set.count(), 3);
  for (int view = 0; view < 3; ++view) EXPECT_EQ(*set.pixel(view, 1, 0), 9 + view);
  EXPECT_DOUBLE_EQ(set.aspect(), 2.0);

  write_woven(WovenFrame({.width = 1, .height = 2}).view(), folder / "12.png");
  EXPECT_THAT(error_of([&] { (void)read(); }).what(), HasSubstr("12.png: 1 x 2"));
  std::filesystem::remove(folder / "10.png");
  EXPECT_THAT(error_of([&] { (void)read(); }).what(), HasSubstr("10.png: missing"));
}

}  // namespace
}  // namespace lenticule::frames
