// SPDX-License-Identifier: Apache-2.0
// Tests names of third-party pictures, and view sets combined from several sources.
#include "frames/views_input/view_input.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>

#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using ::testing::HasSubstr;

TEST(ContentName, FindsStereoLayoutsInNames) {
  const std::pair<const char*, StereoLayout> names[] = {
      {"film_sbs.mkv", {.beside = true, .half = false}},
      {"a/film_HSBS_%05d.png", {.beside = true, .half = true}},
      {"film.half-sbs.mkv", {.beside = true, .half = true}},
      {"film_sbs_half.png", {.beside = true, .half = true}},
      {"film_tb.png", {.beside = false, .half = false}},
      {"film_htb.png", {.beside = false, .half = true}},
      {"a-hsbs.png", {.beside = true, .half = true}},
      {"a.left-right.png", {.beside = true}},
      {"aSBS.png", {.beside = true}},
      {"a_180_sbs.png", {.beside = true}},
      {"a_2x1.png", {.beside = true}},
      {"a_half_2x1.png", {.beside = true, .half = true}},
      {"a_left-right_half.png", {.beside = true, .half = true}},
      {"a_3dh.png", {.beside = true}},
      {"a_3DV.mp4", {.beside = false}},
      {"a_FSBS.png", {.beside = true}},
      {"a_LR.png", {.beside = true}},
      {"a_LRQ.png", {.beside = true, .half = true}},
      {"a_RL.png", {.beside = true, .right_first = true}},
      {"a_OU.png", {.beside = false}},
      {"a_over-under.png", {.beside = false}},
      {"a_hou.png", {.beside = false, .half = true}},
      {"a_half-tab.mkv", {.beside = false, .half = true}},
      {"a_SBS_3840.png", {.beside = true}},
      {"a_full_sbs.png", {.beside = true}},
      {"a_sidebyside.png", {.beside = true}},
      {"a.jps", {.beside = true, .right_first = true}},
      {"a_lr.jps", {.beside = true}},
      {"a.pns", {.beside = true, .right_first = true}}};
  for (const auto& [name, layout] : names) EXPECT_EQ(stereo_of_name(name), layout) << name;
  for (const char* const name : {"sbs.png", "film.png", "sbs/film.png", "filmsbs.png", "half.png",
                                 "my-left-foot.png", "table_top.png", "12x1.png", "colour.png"})
    EXPECT_FALSE(stereo_of_name(name)) << name;
  EXPECT_TRUE(is_rgbd_name("cat_rgbd.png"));
  EXPECT_TRUE(is_rgbd_name("cat_RGBD_%03d.png"));
  EXPECT_FALSE(is_rgbd_name("rgbd/cat.png"));
}

TEST(ContentName, TheTagOfAStereoJpegStatesItsLayout) {
  const auto layout = [](uint8_t flags, uint8_t kind, uint8_t type = 1) {
    std::vector<uint8_t> head = {0xFF, 0xD8, 0xFF, 0xE0, 0,   4,   'J', 'F',  // a segment before it
                                 0xFF, 0xE3, 0,    16,   '_', 'J', 'P', 'S', 'J', 'P', 'S', '_'};
    head.insert(head.end(), {0, 4, 0, flags, kind, type, 0xFF, 0xDA});
    return parse_jps_tag(head, "a.jps");
  };
  EXPECT_EQ(layout(0, 2), (StereoLayout{.beside = true, .right_first = true})) << "cross-eyed";
  EXPECT_EQ(layout(4, 2), (StereoLayout{.beside = true})) << "left field first";
  EXPECT_EQ(layout(2, 2), (StereoLayout{.beside = true, .half = true, .right_first = true}));
  EXPECT_EQ(layout(5, 3), (StereoLayout{.beside = false, .half = true}));
  EXPECT_EQ(layout(2, 3), (StereoLayout{.beside = false, .right_first = true})) << "of rows";
  EXPECT_THAT(error_of([&] { (void)layout(0, 1); }).what(), HasSubstr("interlaced rows"));
  EXPECT_THAT(error_of([&] { (void)layout(0, 2, 0); }).what(), HasSubstr("not stereoscopic"));
  EXPECT_EQ(parse_jps_tag(std::vector<uint8_t>{0xFF, 0xD8, 0xFF, 0xDA}, "a.jps"), std::nullopt);
}

TEST(ContentName, TheLeftEyeIsTheFirstView) {
  WovenFrame picture({.width = 4, .height = 4});
  for (int row = 0; row < 4; ++row)
    for (int byte = 0; byte < 12; ++byte)
      picture.row(row)[byte] = static_cast<uint8_t>((row / 2) * 100 + byte / 6);
  const auto first = [&](const char* word, bool inverted) {
    StereoLayout stereo = parse_stereo(word);
    stereo.right_first = inverted;
    const StereoTiles tiles = tiles_of(stereo, picture.geometry());
    auto arranged = arrange_quilt(picture.geometry(), tiles.layout, tiles.rightmost_first, "film");
    const FrameView pictures[] = {picture.view()};
    return int{*arranged->arrange(pictures).pixel(0, 0, 0)};
  };
  EXPECT_EQ(first("sbs", false), 0) << "the left half";
  EXPECT_EQ(first("sbs", true), 1);
  EXPECT_EQ(first("tb", false), 0) << "the upper half";
  EXPECT_EQ(first("tb", true), 100);
}

TEST(ContentName, SqueezedEyesHaveTheWholePicturesAspect) {
  const FrameGeometry picture{.width = 192, .height = 108};
  const auto aspect = [&](const char* word) {
    const StereoTiles tiles = tiles_of(parse_stereo(word), picture);
    return arrange_quilt(picture, tiles.layout, false, "film")->shape.aspect;
  };
  EXPECT_DOUBLE_EQ(aspect("sbs"), 96.0 / 108.0);
  EXPECT_DOUBLE_EQ(aspect("hsbs"), 192.0 / 108.0);
  EXPECT_DOUBLE_EQ(aspect("tb"), 192.0 / 54.0);
  EXPECT_DOUBLE_EQ(aspect("htb"), 192.0 / 108.0);
  EXPECT_EQ(parse_stereo("OU"), parse_stereo("tb"));
  EXPECT_EQ(parse_stereo("half-left-right"), parse_stereo("hsbs"));
  for (const char* const text : {"", "rows", "none"})
    EXPECT_EQ(error_of([&] { (void)parse_stereo(text); }).kind(), ErrorKind::Usage) << text;
}

/// Opens pictures of 2 x 2 pixels, each of one code value.
std::unique_ptr<ImageSequence> film(const test::ScratchFolder& folder, const std::string& name,
                                    int frames, int code) {
  std::vector<std::filesystem::path> files;
  for (int n = 0; n < frames; ++n) {
    WovenFrame picture({.width = 2, .height = 2});
    std::fill(picture.bytes().begin(), picture.bytes().end(), static_cast<uint8_t>(code + n));
    files.push_back(folder.path() / fmt::format("{}{}.png", name, n));
    write_woven(picture.view(), files.back());
  }
  return std::make_unique<ImageSequence>(files);
}

PullStatus next_of(ViewInput& input) {
  for (int n = 0; n < 100; ++n) {
    const PullStatus status = input.next();
    if (status != PullStatus::NotYet) return status;
    input.wait(std::chrono::milliseconds(100));
  }
  return PullStatus::NotYet;
}

TEST(ViewInput, CombinesThePicturesOfOneTimeInEveryLoop) {
  const test::ScratchFolder folder;
  std::vector<std::unique_ptr<FrameSource>> films;
  for (int view = 0; view < 3; ++view)
    films.push_back(film(folder, fmt::format("v{}_", view), 4, 50 * view));
  auto arrangement = arrange_pictures({.width = 2, .height = 2}, 3, 1.5, true);
  ViewInput input(std::move(films), std::move(arrangement), "films");
  EXPECT_EQ(input.frame_count(), 4U);
  EXPECT_EQ(input.shape(), (ViewShape{.count = 3, .width = 2, .height = 2, .aspect = 1.5}));
  for (int round = 0; round < 2; ++round) {
    for (int n = 0; n < 4; ++n) {
      ASSERT_EQ(next_of(input), PullStatus::Ready);
      EXPECT_EQ(input.number(), static_cast<uint64_t>(n));
      for (int view = 0; view < 3; ++view)
        EXPECT_EQ(int{*input.views().pixel(view, 1, 1)}, 50 * (2 - view) + n);
      input.release();
    }
    ASSERT_EQ(next_of(input), PullStatus::End);
    ASSERT_TRUE(input.rewind());
  }
}

TEST(ViewInput, RefusesPartsOfDifferentLengths) {
  const test::ScratchFolder folder;
  std::vector<std::unique_ptr<FrameSource>> films;
  films.push_back(film(folder, "a", 3, 0));
  films.push_back(film(folder, "b", 2, 0));
  const Error error = error_of([&] {
    ViewInput input(std::move(films), arrange_pictures({.width = 2, .height = 2}, 2, {}, false),
                    "films");
  });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_NE(std::string(error.what()).find("one part has 3 frames, another 2"), std::string::npos)
      << error.what();
}

TEST(ViewInput, DepthCanBeAtAnySideInThreeSizes) {
  for (const char* const side : {"right", "left", "bottom", "top"})
    for (const char* const size : {"", ":half", ":quarter"}) {
      const DepthLayout layout = parse_depth_layout(std::string(side) + size).value();
      const bool beside = layout.place == DepthPlace::Right || layout.place == DepthPlace::Left;
      const bool last = layout.place == DepthPlace::Right || layout.place == DepthPlace::Bottom;
      const bool whole = layout.part == DepthPart::Whole;
      const int depth_along = (beside ? 12 : 6) / (whole ? 1 : 2);
      const int depth_across = (beside ? 6 : 12) / (layout.part == DepthPart::Quarter ? 2 : 1);
      const FrameGeometry geometry{.width = 12 + (beside ? depth_along : 0),
                                   .height = 6 + (beside ? 0 : depth_along)};
      WovenFrame picture(geometry);
      for (int row = 0; row < geometry.height; ++row)
        for (int i = 0; i < geometry.width; ++i) {
          const int along = (beside ? i : row) - (last ? 0 : depth_along);
          const bool is_colour = along >= 0 && along < (beside ? 12 : 6);
          const bool is_depth = !is_colour && (beside ? row : i) < depth_across;
          const int column = beside ? along : i;
          const int code = is_colour ? column * 20 : is_depth ? 255 : 0;
          std::fill_n(picture.row(row) + i * 3, 3, static_cast<uint8_t>(code));
        }
      const DepthWindows windows = depth_windows(geometry, layout, "cat");
      auto arranged = arrange_depth(windows.colour.size, windows, {},
                                    {.views = 2, .back = 0.0, .front = 2.0, .in_pixels = true});
      EXPECT_EQ(arranged->shape.width, 12);
      EXPECT_EQ(arranged->shape.height, 6);
      const FrameView pictures[] = {picture.view()};
      const ViewSet views = arranged->arrange(pictures);
      for (const int row : {0, 5}) {
        EXPECT_EQ(int{*views.pixel(0, 6, row)}, 100) << "moved to the right: " << side << size;
        EXPECT_EQ(int{*views.pixel(1, 6, row)}, 140) << side << size;
      }
    }
  for (const char* const text : {"", "right:", "right:third", "rightmost", "depth.png"})
    EXPECT_FALSE(parse_depth_layout(text)) << text;
  EXPECT_EQ(error_of([] {
              (void)depth_windows({.width = 2, .height = 9}, {.part = DepthPart::Half}, "cat.png");
            }).kind(),
            ErrorKind::Input);
}

TEST(ViewInput, TheZeroPlaneIsAtOnePlaceInAllViews) {
  // Three views of 24 pixels with a line of disparity 4: at 12, 10 and 8.
  const test::ScratchFolder folder;
  WovenFrame quilt({.width = 72, .height = 2});
  for (int view = 0; view < 3; ++view)
    for (int row = 0; row < 2; ++row) quilt.row(row)[(view * 24 + 12 - 2 * view) * 3] = 255;
  write_woven(quilt.view(), folder / "q.png");
  const auto line_in = [&](const ViewCrop& crop, int view) {
    std::vector<std::unique_ptr<FrameSource>> pictures;
    pictures.push_back(std::make_unique<ImageSequence>(std::vector{folder / "q.png"}));
    ViewInput input(std::move(pictures),
                    arrange_quilt(quilt.view().geometry, {.columns = 3, .aspect = 2.0}, false, "q"),
                    "q", crop);
    EXPECT_EQ(input.shape(), (ViewShape{3, 20, 2, 2.0 * 20 / 24}));
    while (input.next() == PullStatus::NotYet) input.wait(std::chrono::milliseconds(10));
    const ViewSet& views = input.views();
    EXPECT_EQ(shape_of(views), input.shape());
    for (int column = 0; column < views.width(); ++column)
      if (*views.pixel(view, column, 1) == 255) return column;
    return -1;
  };
  for (int view = 0; view < 3; ++view) {
    EXPECT_EQ(line_in({.zero_plane = {.value = 4.0, .in_pixels = true}}, view), 8);
    EXPECT_EQ(line_in({.zero_plane = {.value = 4.0 / 24.0}}, view), 8);
  }
  const ViewCrop back{.zero_plane = {.value = -4.0, .in_pixels = true}};
  EXPECT_EQ(line_in(back, 0) - line_in(back, 2), 8) << "twice as far in front";
  const auto size = [](const ViewCrop& crop) {
    (void)cropped_size({.width = 8, .height = 8}, crop);
  };
  EXPECT_EQ(error_of([&] { size({.zero_plane = {1.0}}); }).kind(), ErrorKind::Usage);
}

TEST(ViewInput, ZoomKeepsTheMiddle) {
  WovenFrame picture({.width = 40, .height = 20});
  picture.row(5)[10 * 3] = 1;
  picture.row(14)[29 * 3] = 2;
  const std::vector<FrameView> one = {picture.view()};
  const ViewSet middle = ViewSet::borrow(one).cropped({.zoom = 2.0});
  EXPECT_EQ(middle.width(), 20);
  EXPECT_EQ(middle.height(), 10);
  EXPECT_DOUBLE_EQ(middle.aspect(), 2.0);
  EXPECT_EQ(int{*middle.pixel(0, 0, 0)}, 1);
  EXPECT_EQ(int{*middle.pixel(0, 19, 9)}, 2);
  for (const double none : {1.0, 0.0, -3.0, std::nan("")})
    EXPECT_EQ(cropped_size({.width = 40, .height = 20}, {.zoom = none}).width, 40) << none;
  EXPECT_EQ(cropped_size({.width = 40, .height = 20}, {.zoom = 1e9}).height, 1);
}

}  // namespace
}  // namespace lenticule::frames
