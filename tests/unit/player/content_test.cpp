// SPDX-License-Identifier: Apache-2.0
// Tests what the name of a file says about its pictures.
#include "player/sources/content.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

/// Returns "8x6v45 a0.75", "half rl", "rgbd" or "woven"; for an error "refused".
std::string meaning_of(const std::string& name) {
  Content content;
  try {
    content = identify(parse_source(name), "");
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input) << error.what();
    return "refused";
  }
  if (content.kind == Content::Kind::Quilt) {
    const frames::QuiltLayout& quilt = content.layout;
    std::string text = fmt::format("{}x{}", quilt.columns, quilt.rows);
    if (quilt.views != 0) text += fmt::format("v{}", quilt.views);
    if (quilt.aspect) text += fmt::format(" a{}", *quilt.aspect);
    if (content.crop.zoom != 1.0) text += fmt::format(" z{}", content.crop.zoom);
    return text;
  }
  if (content.kind == Content::Kind::Stereo) {
    const frames::StereoLayout& eyes = content.stereo;
    const char* const order = eyes.beside        ? eyes.right_first ? "rl" : "lr"
                              : eyes.right_first ? "bt"
                                                 : "tb";
    return eyes.half ? fmt::format("half {}", order) : order;
  }
  return content.kind == Content::Kind::DepthInside ? "rgbd" : "woven";
}

TEST(ContentName, EveryUsualNameHasItsMeaning) {
  const std::pair<const char*, const char*> names[] = {
      {"a-hsbs.png", "half lr"},
      {"a.left-right.png", "lr"},
      {"a.pns", "rl"},
      {"aSBS.png", "lr"},
      {"a_180_sbs.png", "lr"},
      {"a_2x1.png", "lr"},
      {"a_3dh.png", "lr"},
      {"a_FSBS.png", "lr"},
      {"a_LR.png", "lr"},
      {"a_LRQ.png", "half lr"},
      {"a_OU.png", "tb"},
      {"a_RL.png", "rl"},
      {"a_SBS_3840.png", "lr"},
      {"a_TB.png", "tb"},
      {"a_bottom-top.png", "bt"},
      {"a_full_sbs.png", "lr"},
      {"a_half_2x1.png", "half lr"},
      {"a_half-sbs.png", "half lr"},
      {"a_hou.png", "half tb"},
      {"a_left-right.png", "lr"},
      {"a_sbs.png", "lr"},
      {"a_sidebyside.png", "lr"},
      {"a_tab.png", "tb"},
      {"cat_RGBD.png", "rgbd"},
      {"alpha_qs8x6.png", "8x6"},
      {"pad_qs5x9a1.777.png", "5x9 a1.777"},
      {"q qs8x6a0.75.png", "8x6 a0.75"},
      {"q_8x6_qs.png", "refused"},
      {"q_qs0x6.png", "refused"},
      {"q_qs08x06a0.75.png", "8x6 a0.75"},
      {"q_qs5x9a1.777_qs8x6a0.75.png", "8x6 a0.75"},
      {"q_qs8X6a0.75.png", "8x6 a0.75"},
      {"q_QS8X6A0.75.PNG", "8x6 a0.75"},
      {"q_qs8x6.png", "8x6"},
      {"q_qs8x6a.75.png", "8x6 a0.75"},
      {"q_qs8x6a0.5625copy.png", "8x6 a0.5625"},
      {"q_qs8x6a0.75 (1).png", "8x6 a0.75"},
      {"q_qs8x6a0.75-loop.png", "8x6 a0.75"},
      {"q_qs8x6a0.75.png", "8x6 a0.75"},
      {"q_qs8x6a0.75.q.png", "8x6 a0.75"},
      {"q_qs8x6a0.75_1.png", "8x6 a0.75"},
      {"q_qs8x6a0.75_30fps.png", "8x6 a0.75"},
      {"q_qs8x6a0.75f0.2z1.png", "8x6 a0.75"},
      {"q_qs8x6a0.75z1.2f0.0.png", "8x6 a0.75 z1.2"},
      {"q_qs8x6a1.png", "8x6 a1"},
      {"q_qs8x6a3:4.png", "8x6 a0.75"},
      {"q_qs8x6v45a0.75.png", "8x6v45 a0.75"},
      {"q_qs8x6_sbs.png", "8x6"},
      {"qs8x6a0.75.png", "8x6 a0.75"},
      {"film.png", "woven"},
      {"sbs.png", "woven"},
      {"seqs8x6.png", "woven"},
      {"qsort.png", "woven"}};
  for (const auto& [name, meaning] : names) EXPECT_EQ(meaning_of(name), meaning) << name;
}

TEST(ContentName, ANameThatLooksLikeAQuiltsWithoutAGridIsAnError) {
  const auto with = [](ContentFlags flags) { return parse_source("q_8x6_qs.png", flags); };
  const Error error = test::error_of([&] { (void)identify(with({}), ""); });
  EXPECT_THAT(error.what(), testing::StartsWith("q_8x6_qs.png: its name says qs"));
  EXPECT_EQ(identify(with({.grid = "8x6"}), "").kind, Content::Kind::Quilt);
  EXPECT_EQ(identify(with({.stereo = "none"}), "").kind, Content::Kind::Woven);
}

TEST(ContentName, ACommentInThePictureCompletesAPlainName) {
  const test::ScratchFolder folder;
  const std::string comment = R"({"LKGRows":6,"LKGColumns":8,"LKGAspect":0.75})";
  for (const char* const name : {"city.jpg", "city_sbs.jpg", "city_qs2x1.jpg"})
    std::ofstream(folder / name) << "head " << comment << " tail";
  EXPECT_EQ(meaning_of(folder / "city.jpg"), "8x6 a0.75");
  EXPECT_EQ(meaning_of(folder / "city_sbs.jpg"), "lr") << "the name decides";
  EXPECT_EQ(meaning_of(folder / "city_qs2x1.jpg"), "2x1");
  for (const bool big_endian : {false, true}) {
    std::string utf16("UNICODE", 8);
    for (const char c : comment) utf16 += big_endian ? std::string{'\0', c} : std::string{c, '\0'};
    std::ofstream(folder / "city.jpg") << "head " << utf16 << " tail";
    EXPECT_EQ(meaning_of(folder / "city.jpg"), "8x6 a0.75") << big_endian;
  }
}

TEST(ContentFlags, AreParsedOrRefused) {
  const auto with = [](ContentFlags flags) { return identify(parse_source("a.png", flags), ""); };
  EXPECT_EQ(with({.stereo = "sbs", .zero_plane = "1.5"}).crop.zero_plane,
            (frames::Disparity{.value = 0.015}));
  EXPECT_EQ(with({.stereo = "sbs", .zero_plane = "-20px"}).crop.zero_plane,
            (frames::Disparity{.value = -20.0, .in_pixels = true}));
  const Content depth = with({.depth = "left:half", .depth_distance = "0.5:20"});
  EXPECT_EQ(depth.depth, (frames::DepthLayout{frames::DepthPlace::Left, frames::DepthPart::Half}));
  EXPECT_EQ(depth.depth_options.distance_ratio, 40.0);
  const ContentFlags wrong[] = {{.zero_plane = "1"},
                                {.stereo = "sbs", .zero_plane = "1cm"},
                                {.stereo = "sbs", .depth_distance = "1:2"},
                                {.stereo = "sbs", .depth_budget = 1.0},
                                {.depth = "right", .depth_distance = "0:2"},
                                {.depth = "right", .depth_distance = "2:1"},
                                {.depth = "right", .depth_distance = "2"}};
  for (const ContentFlags& flags : wrong)
    EXPECT_EQ(test::error_of([&] { (void)with(flags); }).kind(), ErrorKind::Usage)
        << flags.zero_plane << flags.depth_distance;
}

}  // namespace
}  // namespace lenticule::player
