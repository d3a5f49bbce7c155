// SPDX-License-Identifier: Apache-2.0
#include "player/camera_path.h"

#include <gtest/gtest.h>

#include "optics/error.h"

namespace lenticule::player {
namespace {

TEST(CameraPath, IsOneCameraPerLine) {
  const auto path = parse_camera_path(
      "# from, at, up, field of view\n"
      "1 2 3  0 0 0  0 1 0  30\n"
      "\n"
      "4,5,6, 0,0,0, 0,0,1   # commas are fine too\r\n",
      "path.txt");
  ASSERT_EQ(path.size(), 2U);
  EXPECT_EQ(path[0].from, (Vec3{1, 2, 3}));
  EXPECT_EQ(path[0].vertical_fov_degrees, 30.0);
  EXPECT_EQ(path[1].from, (Vec3{4, 5, 6}));
  EXPECT_EQ(path[1].up, (Vec3{0, 0, 1}));
  EXPECT_EQ(path[1].vertical_fov_degrees, 45.0);
}

TEST(CameraPath, NamesTheLineThatIsWrong) {
  const auto error_of = [](const std::string& text) -> std::string {
    try {
      (void)parse_camera_path(text, "path.txt");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
      return error.what();
    }
    return "";
  };
  const std::string good = "1 2 3 0 0 0 0 1 0\n";
  EXPECT_EQ(error_of(good + "1 2 3\n"), "path.txt:2: 3 numbers instead of 9 or 10");
  EXPECT_EQ(error_of(good + good + "1 2 x 0 0 0 0 1 0\n"), "path.txt:3: not a number");
  EXPECT_EQ(error_of("1 2 nan 0 0 0 0 1 0\n"), "path.txt:1: not a number");
  EXPECT_EQ(error_of("0 0 0 0 0 0 0 1 0\n"),
            "path.txt:1: the camera looks at itself or along its up vector");
  EXPECT_EQ(error_of("0 9 0 0 0 0 0 1 0\n"),
            "path.txt:1: the camera looks at itself or along its up vector");
  EXPECT_EQ(error_of("1 2 3 0 0 0 0 1 0 180\n"), "path.txt:1: a field of view of 180 degrees");
  EXPECT_EQ(error_of("# nothing\n"), "path.txt: no camera in it");
}

}  // namespace
}  // namespace lenticule::player
