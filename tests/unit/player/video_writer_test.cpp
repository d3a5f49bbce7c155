// SPDX-License-Identifier: Apache-2.0
// Tests that a video file appears under its name only when complete.
#include "apps/lenticule-tools/offline/video_writer.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/support/error_matchers.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;

class VideoWrites : public test::VideoTest {
 protected:
  [[nodiscard]] VideoWriterOptions options(const std::string& name,
                                           const char* program = LENTICULE_VIDEO_PROGRAM) const {
    return {.file = file(name), .geometry = kSmall, .rate = {60, 1}, .program = program};
  }
  [[nodiscard]] size_t files() const {
    return static_cast<size_t>(
        std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
};

TEST_F(VideoWrites, LeavesNoFileWithoutFinish) {
  {
    VideoWriter writer(options("clip.mkv"));
    writer.write(clip_frame(0).view());
    EXPECT_FALSE(fs::exists(file("clip.mkv")));
  }
  EXPECT_EQ(files(), 0u);
}

TEST_F(VideoWrites, KeepsTheOldFileUntilTheNewOneIsComplete) {
  std::ofstream(file("clip.mkv")) << "old";
  VideoWriter writer(options("clip.mkv"));
  writer.write(clip_frame(0).view());
  EXPECT_EQ(fs::file_size(file("clip.mkv")), 3u);
  writer.finish();
  EXPECT_GT(fs::file_size(file("clip.mkv")), 100u);
  EXPECT_EQ(files(), 1u);
}

TEST_F(VideoWrites, ReportsAMissingFolder) {
  EXPECT_THROW(VideoWriter(options("absent/clip.mkv")), Error);
}

TEST_F(VideoWrites, AnEncoderThatEndsIsReported) {
  VideoWriter writer(options("clip.mkv", "/bin/false"));
  const auto write_on = [&] {
    for (int k = 0; k < 10000; ++k) writer.write(clip_frame(0).view());
    writer.finish();
  };
  EXPECT_THROW(write_on(), Error);
  EXPECT_FALSE(fs::exists(file("clip.mkv")));
}

TEST_F(VideoWrites, AFileWithoutFramesIsAnError) {
  VideoWriter writer(options("clip.mkv"));
  EXPECT_THAT(test::error_of([&] { writer.finish(); }).what(), testing::HasSubstr("no frame"));
  EXPECT_FALSE(fs::exists(file("clip.mkv")));
}

}  // namespace
}  // namespace lenticule::tools
