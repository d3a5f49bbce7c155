// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "render/loaders/animation.h"
#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

std::string refusal(const std::string& text) {
  const Error error = error_of([&] { (void)parse_camera_path(text, "walk.path"); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  return error.what();
}

TEST(CameraPath, ReadsOnePoseALine) {
  const auto path = parse_camera_path(
      "# from      at     up\n1 2 3   0 0 0   0 1 0\n\n4 5 6   0 0 0   0 1 0   30 # narrower\n",
      "walk.path");
  ASSERT_THAT(path, SizeIs(2));
  EXPECT_EQ(path[0].from, (Vec3{1, 2, 3}));
  EXPECT_EQ(path[0].vertical_fov_degrees, 45.0);
  EXPECT_EQ(path[1].from, (Vec3{4, 5, 6}));
  EXPECT_EQ(path[1].at, (Vec3{0, 0, 0}));
  EXPECT_EQ(path[1].up, (Vec3{0, 1, 0}));
  EXPECT_EQ(path[1].vertical_fov_degrees, 30.0);
}

TEST(CameraPath, APoseMustEndOnItsLine) {
  EXPECT_THAT(refusal("0 0 1 0 0 0 0 1 0\n0 0 1 0 0 0\n0 1 0\n"),
              StartsWith("walk.path:2: a pose has nine numbers"));
}

TEST(CameraPath, RefusesInvalidPoses) {
  EXPECT_THAT(refusal("# nothing\n"), HasSubstr("no pose"));
  EXPECT_THAT(refusal("0 0 1 0 0 x 0 1 0\n"), StartsWith("walk.path:1: a pose's number"));
  EXPECT_THAT(refusal("\n0 0 1 0 0 nan 0 1 0\n"), StartsWith("walk.path:2:"));
  EXPECT_THAT(refusal("0 0 1 0 0 1 0 1 0\n"), HasSubstr("from and at are the same point"));
  EXPECT_THAT(refusal("0 0 1 0 0 0 0 0 1\n"), HasSubstr("up is parallel"));
  EXPECT_THAT(refusal("0 0 1 0 0 0 0 1 0 180\n"), HasSubstr("field of view of 180"));
  EXPECT_THAT(refusal("0 0 1 0 0 0 0 1 0 30 1\n"), HasSubstr("more than ten"));
  EXPECT_THAT(refusal("1e20 0 1 0 0 0 0 1 0\n"), HasSubstr("1e+20 is out of range"));
}

TEST(CameraPath, LoadsAFileAndNamesAMissingOne) {
  const auto file = std::filesystem::path(::testing::TempDir()) / "lenticule-walk.path";
  std::ofstream(file) << "0 0 1 0 0 0 0 1 0\n";
  EXPECT_THAT(load_camera_path(file), SizeIs(1));
  std::filesystem::remove(file);
  EXPECT_THAT(error_of([&] { (void)load_camera_path(file); }).what(), HasSubstr(file.string()));
}

}  // namespace
}  // namespace lenticule::render
