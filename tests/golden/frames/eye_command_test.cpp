// SPDX-License-Identifier: Apache-2.0
#include "frame_command_test.h"

namespace lenticule::test {
namespace {

class EyeCommand : public FrameCommandTest {
 protected:
  [[nodiscard]] ProcessResult eye(const std::string& woven, const std::string& place,
                                  std::vector<std::string> more = {},
                                  const ProcessLimits& limits = {}) const {
    std::vector<std::string> arguments = {
        "eye", woven, "--rig", path("rig.toml"), "-o", path("seen.png"), "--eye", place};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments, limits);
  }
};

TEST_F(EyeCommand, SeesAGreyPanelAsGrey) {
  const auto done =
      json_of(eye(picture("woven.png", kWidth, kHeight, 90), "-10,0,600", {"--json"}));
  EXPECT_EQ(done["eye_mm"], (nlohmann::json{-10.0, 0.0, 600.0}));
  const auto seen = frames::read_woven(path("seen.png"));
  EXPECT_EQ(seen.width(), done["width"]);
  EXPECT_EQ(seen.height(), done["height"]);
  const int middle = seen.width() / 2 * 3;
  EXPECT_EQ(seen.row(seen.height() / 2)[middle], 90);
}

TEST_F(EyeCommand, MakesAPictureOfTheRequestedSize) {
  ASSERT_EQ(
      eye(picture("woven.png", kWidth, kHeight, 90), "0,0,600", {"--size", "31x17"}).exit_code, 0);
  EXPECT_EQ(frames::probe_image(path("seen.png")),
            (frames::FrameGeometry{.width = 31, .height = 17}));
}

TEST_F(EyeCommand, RefusesAFrameOfAnotherPanel) {
  expect_failure(eye(picture("woven.png", kHeight, kWidth, 90), "0,0,600"), 4,
                 "32 x 48 pixels, the rig's panel has 48 x 32");
  expect_failure(eye(path("none.png"), "0,0,600"), 4, "none.png");
  const std::string whole = picture("whole.png", kWidth, kHeight, 90);
  expect_failure(eye(truncated(whole, "cut.png"), "0,0,600"), 4, "truncated");
  EXPECT_FALSE(std::filesystem::exists(path("seen.png")));
}

TEST_F(EyeCommand, RefusesInvalidPlacesAndSizes) {
  const std::string woven = picture("woven.png", kWidth, kHeight, 90);
  for (const char* place : {"0,0", "0,0,0", "0,0,-5", "a,b,c", "nan,0,600", "0,0,inf", "1,2,3,4"})
    expect_failure(eye(woven, place), 2, "--eye");
  for (const char* size : {"0x5", "5", "5x", "-1x5", "99999x5", "5x5x5"})
    expect_failure(eye(woven, "0,0,600", {"--size", size}), 2, "--size");
  EXPECT_FALSE(std::filesystem::exists(path("seen.png")));
}

TEST_F(EyeCommand, LeavesNoFileOnAFullDisk) {
  const std::string woven = picture("woven.png", kWidth, kHeight, 90);
  // The limit permits the memory that a decoder shares; the picture has 9 million bytes.
  const ProcessResult result = run({"eye", woven, "--rig", path("rig.toml"), "--eye", "0,0,600",
                                    "--size", "2000x1500", "-o", path("seen.ppm")},
                                   {.largest_file_bytes = 8'500'000});
  expect_failure(result, 1, "seen.ppm");
  before_.emplace_back("woven.png");
  EXPECT_EQ(listing(), before_);
}

}  // namespace
}  // namespace lenticule::test
