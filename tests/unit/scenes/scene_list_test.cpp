// SPDX-License-Identifier: Apache-2.0
// Tests the table of built-in scenes and their text.
#include "scenes/scene_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <sstream>

#include "base/error.h"
#include "scenes/scene_writer.h"

namespace lenticule::scenes {
namespace {

/// Returns the number of lines whose first word is `keyword`.
int count_lines(const std::string& text, const std::string& keyword) {
  std::istringstream in(text);
  int count = 0;
  for (std::string line; std::getline(in, line);) {
    std::string word;
    std::istringstream(line) >> word;
    count += word == keyword ? 1 : 0;
  }
  return count;
}

std::string write(const char* name, int size, int frame = 0) {
  return write_scene(find_scene(name), size, frame);
}

TEST(SceneList, NamesAreUniqueAndDescribed) {
  std::set<std::string> names;
  for (const BuiltInScene& scene : scene_list()) {
    EXPECT_TRUE(names.insert(scene.name).second) << scene.name;
    EXPECT_STRNE(scene.summary, "");
    EXPECT_GE(scene.frames, 1);
    EXPECT_LE(scene.default_size, scene.largest_size);
  }
  EXPECT_THAT(names, ::testing::IsSupersetOf({"demo", "teapot", "balls", "tree"}));
}

TEST(SceneList, AnUnknownNameIsAUsageErrorThatListsTheOthers) {
  try {
    (void)find_scene("teapod");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("teapod"));
    EXPECT_THAT(error.hint(), ::testing::HasSubstr("teapot"));
  }
}

TEST(NffWriter, PredictsTheNumberThatAReaderGets) {
  EXPECT_EQ(as_read_from_nff(0.1), 0.1);
  EXPECT_EQ(as_read_from_nff(1.0 / 3.0), 0.333333333);
  EXPECT_EQ(as_read_from_nff(-1234567890.6), -1234567890.0);
  EXPECT_EQ(as_read_from_nff(1.00000000049e-17), 1e-17);
  EXPECT_FALSE(std::signbit(as_read_from_nff(-0.0)));
  for (double number = 1e-20; number < 1e20; number *= 7.13) {
    NffWriter text;
    text.add(Background{{number, -number, 0.0}});
    std::istringstream words(text.take().substr(1));
    double first = 0.0, second = 0.0;
    words >> first >> second;
    EXPECT_EQ(as_read_from_nff(number), first);
    EXPECT_EQ(as_read_from_nff(-number), second);
    EXPECT_EQ(as_read_from_nff(first), first);
  }
}

TEST(SceneList, RefusesSizesAndFramesOutOfRange) {
  const BuiltInScene& teapot = find_scene("teapot");
  EXPECT_THROW((void)write_scene(teapot, 0), Error);
  EXPECT_THROW((void)write_scene(teapot, teapot.largest_size + 1), Error);
  EXPECT_THROW((void)write_scene(teapot, 1, -1), Error);
}

TEST(SceneList, TheSameArgumentsGiveTheSameBytes) {
  for (const BuiltInScene& scene : scene_list())
    EXPECT_EQ(write_scene(scene, 2, 1), write_scene(scene, 2, 1)) << scene.name;
}

TEST(SceneList, SequencesRepeatAfterTheirLastFrame) {
  for (const BuiltInScene& scene : scene_list()) {
    EXPECT_EQ(write_scene(scene, 1, scene.frames), write_scene(scene, 1, 0)) << scene.name;
    if (scene.frames > 1) {
      EXPECT_NE(write_scene(scene, 1, 1), write_scene(scene, 1, 0)) << scene.name;
    }
  }
}

TEST(SceneList, NoNumberIsWrittenAsMinusZeroOrNotFinite) {
  for (const BuiltInScene& scene : scene_list()) {
    std::istringstream words(write_scene(scene, 2, scene.frames / 4));
    for (std::string word; words >> word;) {
      ASSERT_NE(word, "-0") << scene.name;
      ASSERT_THAT(word, ::testing::Not(::testing::AnyOf("nan", "-nan", "inf", "-inf")));
    }
  }
}

TEST(TeapotScene, HasTheClassicCounts) {
  for (const int n : {1, 2, 3, 6}) {
    const std::string text = write("teapot", n);
    EXPECT_EQ(count_lines(text, "pp"), 64 * n * n - 8 * n);
    EXPECT_EQ(count_lines(text, "p"), n * n);
    EXPECT_EQ(count_lines(text, "l"), 2);
  }
}

TEST(TeapotScene, TheCameraStartsAtTheClassicPlaceAndKeepsItsHeight) {
  EXPECT_THAT(write("teapot", 1), ::testing::HasSubstr("from 4.86 7.2 5.4\n"));
  EXPECT_THAT(write("teapot", 1, 306), ::testing::HasSubstr("from -4.86 -7.2 5.4\n"));
}

TEST(BallsScene, HasNineChildrenPerSphere) {
  EXPECT_EQ(count_lines(write("balls", 1), "s"), 10);
  EXPECT_EQ(count_lines(write("balls", 2), "s"), 91);
  EXPECT_EQ(count_lines(write("balls", 4), "s"), 7381);
  EXPECT_EQ(count_lines(write("balls", 1), "p"), 1);
  EXPECT_EQ(count_lines(write("balls", 1), "l"), 3);
}

TEST(TreeScene, EveryBranchHasAJointAndForksInTwo) {
  for (const int n : {1, 2, 5, 11}) {
    const std::string text = write("tree", n);
    EXPECT_EQ(count_lines(text, "c"), (2 << n) - 1);
    EXPECT_EQ(count_lines(text, "s"), (2 << n) - 1);
    EXPECT_EQ(count_lines(text, "p"), 1);
    EXPECT_EQ(count_lines(text, "l"), 7);
  }
}

TEST(DemoScene, OnlyTheTeapotMovesBetweenFrames) {
  std::istringstream first(write("demo", 1, 0));
  std::istringstream later(write("demo", 1, 7));
  int same = 0;
  int different_patch_lines = 0;
  std::string a;
  std::string b;
  bool in_patch = false;
  while (std::getline(first, a) && std::getline(later, b)) {
    if (a == "pp 3") in_patch = true;
    if (!a.starts_with(' ') && a != "pp 3") in_patch = false;
    if (a == b) {
      ++same;
      continue;
    }
    EXPECT_TRUE(in_patch) << a;
    ++different_patch_lines;
  }
  EXPECT_GT(same, 100);
  EXPECT_GT(different_patch_lines, 56 * 2);
}

}  // namespace
}  // namespace lenticule::scenes
