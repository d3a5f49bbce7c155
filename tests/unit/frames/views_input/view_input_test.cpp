// SPDX-License-Identifier: Apache-2.0
// Tests names of third-party pictures, and view sets combined from several sources.
#include "frames/views_input/view_input.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;

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
      {"a.pns", {.beside = true, .right_first = true}}};
  for (const auto& [name, layout] : names) EXPECT_EQ(stereo_of_name(name), layout) << name;
  for (const char* const name : {"sbs.png", "film.png", "sbs/film.png", "filmsbs.png", "half.png",
                                 "my-left-foot.png", "table_top.png", "12x1.png", "colour.png"})
    EXPECT_FALSE(stereo_of_name(name)) << name;
  EXPECT_TRUE(is_rgbd_name("cat_rgbd.png"));
  EXPECT_TRUE(is_rgbd_name("cat_RGBD_%03d.png"));
  EXPECT_FALSE(is_rgbd_name("rgbd/cat.png"));
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
    return arrange_quilt(picture, tiles.layout, false, "film")->shape().aspect;
  };
  EXPECT_DOUBLE_EQ(aspect("sbs"), 96.0 / 108.0);
  EXPECT_DOUBLE_EQ(aspect("hsbs"), 192.0 / 108.0);
  EXPECT_DOUBLE_EQ(aspect("tb"), 192.0 / 54.0);
  EXPECT_DOUBLE_EQ(aspect("htb"), 192.0 / 108.0);
  EXPECT_EQ(error_of([] { (void)parse_stereo("ou"); }).kind(), ErrorKind::Usage);
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

TEST(ViewInput, DepthCanBeInAnyHalf) {
  for (const DepthPlace place :
       {DepthPlace::Right, DepthPlace::Left, DepthPlace::Bottom, DepthPlace::Top}) {
    const bool beside = place == DepthPlace::Right || place == DepthPlace::Left;
    const bool last = place == DepthPlace::Right || place == DepthPlace::Bottom;
    const FrameGeometry geometry{.width = beside ? 24 : 12, .height = beside ? 6 : 12};
    WovenFrame picture(geometry);
    for (int row = 0; row < geometry.height; ++row)
      for (int i = 0; i < geometry.width; ++i) {
        const bool second = beside ? i >= 12 : row >= 6;
        const int column = i % 12;
        const uint8_t code = second == last ? 0 : static_cast<uint8_t>(column * 20);
        std::fill_n(picture.row(row) + i * 3, 3, code);
      }
    auto arranged = arrange_depth_in(
        geometry, place, {}, {.views = 2, .back = 2.0, .front = 2.0, .in_pixels = true}, "cat");
    EXPECT_EQ(arranged->shape().width, 12);
    EXPECT_EQ(arranged->shape().height, 6);
    const FrameView pictures[] = {picture.view()};
    const ViewSet views = arranged->arrange(pictures);
    EXPECT_EQ(int{*views.pixel(0, 6, 3)}, 100) << "one pixel to the right in the left view";
    EXPECT_EQ(int{*views.pixel(1, 6, 3)}, 140);
  }
}

}  // namespace
}  // namespace lenticule::frames
