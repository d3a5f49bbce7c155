// SPDX-License-Identifier: Apache-2.0
// Tests pictures that are decoded in confined processes.
#include "player/sources/confined_pictures.h"

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <csignal>

#include "base/error.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

/// Collects the rows of one picture.
class Rows final : public frames::PictureSink {
 public:
  void accept(const frames::PictureInfo& info) override {
    frame = frames::WovenFrame(info.geometry);
  }
  std::span<uint8_t> rows(int y, int rows) override {
    const size_t row_bytes = frame.geometry().row_bytes();
    return frame.bytes().subspan(row_bytes * size_t(y), row_bytes * size_t(rows));
  }
  frames::WovenFrame frame;
};

class ConfinedPicturesTest : public test::VideoTest {
 protected:
  void expect_picture() {
    Rows rows;
    pictures_.read(file("good.png"), rows);
    EXPECT_EQ(rows.frame, clip_frame(1));
  }

  void SetUp() override {
    VideoTest::SetUp();
    frames::write_woven(clip_frame(1).view(), file("good.png"));
  }

  ConfinedPictures pictures_{LENTICULE_VIDEO_PROGRAM};
};

TEST_F(ConfinedPicturesTest, OtherFormatsHaveADecoderOfTheirOwn) {
  frames::write_woven(clip_frame(2).view(), file("good.tif"));
  for (int i = 0; i < 2; ++i) {
    expect_picture();
    Rows rows;
    pictures_.read(file("good.tif"), rows);
    EXPECT_EQ(rows.frame, clip_frame(2));
  }
  EXPECT_EQ(pictures_.started(), 2u);
  EXPECT_EQ(pictures_.idle().size(), 2u);
}

TEST_F(ConfinedPicturesTest, TheBytesChooseTheDecoderAndNotTheName) {
  frames::write_woven(clip_frame(2).view(), file("good.tif"));
  std::filesystem::rename(file("good.tif"), file("renamed.png"));
  Rows rows;
  pictures_.read(file("renamed.png"), rows);
  EXPECT_EQ(rows.frame, clip_frame(2));
}

TEST_F(ConfinedPicturesTest, StartingADecoderIsNotPartOfAPicturesTime) {
  const ConfinedPictures with_short_limit(LENTICULE_VIDEO_PROGRAM,
                                          {.processor_time = std::chrono::milliseconds(1)});
  Rows rows;
  with_short_limit.read(file("good.png"), rows);
  EXPECT_EQ(rows.frame, clip_frame(1));
}

TEST_F(ConfinedPicturesTest, ADamagedPictureIsNamedAndTheNextOneIsRead) {
  std::filesystem::copy_file(file("good.png"), file("cut.png"));
  std::filesystem::resize_file(file("cut.png"), 500);
  Rows rows;
  test::expect_error(test::error_of([&] { pictures_.read(file("cut.png"), rows); }),
                     ErrorKind::Input, "cut.png: truncated");
  expect_picture();
}

TEST_F(ConfinedPicturesTest, AnIdleDecoderThatWasKilledIsReplaced) {
  for (int i = 0; i < 5; ++i) {
    expect_picture();
    const std::vector<pid_t> idle = pictures_.idle();
    ASSERT_EQ(idle.size(), 1u);
    ASSERT_EQ(::kill(idle.front(), SIGKILL), 0);
    // Without being reaped: only the reader waits for its processes.
    siginfo_t end{};
    ASSERT_EQ(::waitid(P_PID, id_t(idle.front()), &end, WEXITED | WNOWAIT), 0);
  }
  expect_picture();
  EXPECT_EQ(pictures_.started(), 6u);
}

}  // namespace
}  // namespace lenticule::player
