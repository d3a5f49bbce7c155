// SPDX-License-Identifier: Apache-2.0
// Compares the frames of films whose first and last frames are hard to find with those that the
// program ffmpeg decodes. ffmpeg also makes the films: of RGB, so that the decoded frames are equal
// byte for byte.
#include <gmock/gmock.h>

#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;

constexpr const char* kX264 = "-c:v libx264rgb -qp 4 -g 12 -bf 3 -x264-params scenecut=0";
constexpr const char* kX264Open =
    "-c:v libx264rgb -qp 4 -g 12 -bf 3 -x264-params scenecut=0:open-gop=1";
constexpr const char* kX265Open =
    "-c:v libx265 -pix_fmt gbrp -x265-params "
    "lossless=1:open-gop=1:keyint=12:min-keyint=12:bframes=3:scenecut=0:log-level=none";

class VideoBesideFfmpeg : public test::VideoTest {
 protected:
  /// Writes two seconds of 30 frames each.
  void make(const std::string& name, const std::string& how) const {
    ffmpeg("-f lavfi -i testsrc2=size=64x48:rate=30:duration=2 " + how + " " + name);
  }

  /// Plays two rounds of the film; returns the numbers of frames, with and without repetitions.
  struct Played {
    size_t frames = 0;
    size_t periods = 0;
  };
  Played expect_ffmpegs_frames(const std::string& name) const {
    ffmpeg("-i " + name + " -map 0:v:0 -fps_mode passthrough -f rawvideo -pix_fmt rgb24 frames");
    const std::vector<uint8_t> expected = test::read_bytes(file("frames"));
    VideoRequest wanted = request(file(name));
    wanted.plays_again = true;
    const auto source = open_video(wanted);
    const size_t bytes = source->geometry().frame_bytes();
    EXPECT_GT(expected.size() / bytes, 1u) << name;
    Played played;
    for (int round = 0; round < 2; ++round) {
      played = {};
      frames::AcquiredFrame acquired;
      for (; pull(*source, acquired) == PullStatus::Ready; ++played.periods) {
        played.frames += acquired.repeats ? 0 : 1;
        const auto at = expected.begin() + static_cast<ptrdiff_t>((played.frames - 1) * bytes);
        EXPECT_TRUE(played.frames * bytes <= expected.size() &&
                    std::equal(acquired.frame.bytes.begin(), acquired.frame.bytes.end(), at))
            << name << ", round " << round << ", frame " << played.frames - 1;
        source->release(acquired.token);
      }
      EXPECT_EQ(played.frames, expected.size() / bytes) << name << ": " << source->failure();
      EXPECT_TRUE(source->rewind());
    }
    EXPECT_FALSE(source->damage().any())
        << name << ": " << source->damage().damaged << ", " << source->damage().missing;
    return played;
  }
};

TEST_F(VideoBesideFfmpeg, ReorderedFrames) {
  for (const char* const how : {kX264, kX264Open, kX265Open})
    for (const char* const name : {"whole.mp4", "whole.mkv"}) {
      make(name, how);
      EXPECT_EQ(expect_ffmpegs_frames(name).periods, 60u);
    }
}

TEST_F(VideoBesideFfmpeg, TimesThatDoNotBeginAtZero) {
  for (const char* const name : {"late.mp4", "late.mkv", "late.ts"}) {
    make(name, std::string(kX264) + " -output_ts_offset 7.3");
    EXPECT_EQ(expect_ffmpegs_frames(name).periods, 60u);
  }
}

/// Copied from the middle of a group of pictures: an edit list states which frames are presented.
TEST_F(VideoBesideFfmpeg, EditLists) {
  make("whole.mp4", kX264);
  ffmpeg("-ss 0.7 -i whole.mp4 -t 0.9 -c copy cut.mp4");
  const Played cut = expect_ffmpegs_frames("cut.mp4");
  EXPECT_GE(cut.frames, 27u);
  EXPECT_LE(cut.periods, cut.frames + 3)
      << "those before the last one in display order are cut off";
  ffmpeg("-i whole.mp4 -itsoffset 0.5 -i whole.mp4 -map 1 -c copy delayed.mp4");
  EXPECT_EQ(expect_ffmpegs_frames("delayed.mp4").periods, 60u);
}

/// The first group refers to frames that were cut off.
TEST_F(VideoBesideFfmpeg, OpenGroupsOfPicturesThatWereCut) {
  for (const char* const how : {kX264Open, kX265Open})
    for (const char* const type : {"mp4", "mkv"}) {
      make("whole.mkv", how);
      const std::string name = std::string("cut.") + type;
      ffmpeg("-ss 0.9 -i whole.mkv -c copy " + name);
      const Played played = expect_ffmpegs_frames(name);
      EXPECT_LE(played.periods, played.frames + 3) << "a few frames before the first are left out";
    }
}

TEST_F(VideoBesideFfmpeg, VariableRates) {
  const std::string dense_then_sparse =
      R"(-vf "select='lt(n,20)+not(mod(n,8))'" -fps_mode vfr )" + std::string(kX264);
  for (const char* const name : {"variable.mp4", "variable.mkv"}) {
    make(name, dense_then_sparse);
    const Played played = expect_ffmpegs_frames(name);
    EXPECT_EQ(played.frames, 25u);
    EXPECT_EQ(played.periods, 57u) << "the last frame is number 56";
  }
}

}  // namespace
}  // namespace lenticule::player
