// SPDX-License-Identifier: Apache-2.0
// Tests films of two views (MV-HEVC), as phones and headsets record them: both eyes where FFmpeg
// decodes them, else the first view and a message. tests/data/make_two_views.py draws the same
// views.
#include <gmock/gmock.h>

#include <cmath>

#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"
#include "player/sources/content.h"
#include "player/sources/video_probe.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;
using testing::HasSubstr;

constexpr int kWidth = 64;
constexpr int kHeight = 48;
constexpr uint64_t kFrames = 12;
constexpr int kBlock = 8;
constexpr double kLeastDecibels = 40.0;  ///< other frames, and the other eye, are below 25

enum class Eye { Left, Right };

double luma(Eye eye, uint64_t frame, int x, int y) {
  if (y == kHeight / kBlock - 1) return (frame >> x & 1) != 0 ? 200.0 : 40.0;
  return 40.0 + 24.0 * static_cast<double>((static_cast<uint64_t>(3 * x + 5 * y) + 3 * frame +
                                            (eye == Eye::Right ? 4U : 0U)) %
                                           8);
}

/// Returns a pixel's R, G, B: BT.601 of limited range, as the film has no tags.
std::array<double, 3> colour(Eye eye, uint64_t frame, int x, int y) {
  const double grey = (luma(eye, frame, x / kBlock, y / kBlock) - 16.0) * 255.0 / 219.0;
  const double cb = ((eye == Eye::Right ? 150.0 : 100.0) - 128.0) * 255.0 / 224.0;
  const double cr = ((eye == Eye::Right ? 100.0 : 150.0) - 128.0) * 255.0 / 224.0;
  return {grey + 1.402 * cr, grey - 0.344136 * cb - 0.714136 * cr, grey + 1.772 * cb};
}

/// Returns the peak signal-to-noise ratio of a view that begins at column `from`, in decibels.
double decibels(const frames::FrameView& shown, int from, Eye eye, uint64_t frame) {
  double sum = 0.0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const std::array<double, 3> right = colour(eye, frame, x, y);
      for (size_t c = 0; c < 3; ++c) {
        const auto at = static_cast<size_t>((y * shown.geometry.width + from + x) * 3) + c;
        sum += std::pow(shown.bytes[at] - std::clamp(right[c], 0.0, 255.0), 2);
      }
    }
  return 10.0 * std::log10(255.0 * 255.0 * kWidth * kHeight * 3 / std::max(sum, 1e-9));
}

class VideoOfTwoViews : public test::VideoTest {
 protected:
  [[nodiscard]] static std::string original() {
    return test::read_text(LENTICULE_SOURCE_DIR "/tests/data/two-views.mp4");
  }

  /// Returns the film after one change, which must be possible exactly once.
  [[nodiscard]] static std::string changed(std::string film, const std::string& from,
                                           const std::string& to) {
    const size_t at = film.find(from);
    EXPECT_EQ(from.size(), to.size());
    EXPECT_NE(at, std::string::npos);
    EXPECT_EQ(film.find(from, at + 1), std::string::npos);
    return film.replace(at, to.size(), to);
  }

  /// The SEI message about 3-D reference displays: the left view is number 0, the right one 1.
  const std::string kSei{"\x4e\x01\xb0\x04\x04\x0d\x00\x10", 8};

  [[nodiscard]] VideoRequest views(const std::string& name, const std::string& bytes) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
    VideoRequest wanted = request(file(name));
    wanted.before_weaving = true;
    return wanted;
  }

  static void expect_eyes(const frames::FrameView& shown, uint64_t frame, bool swapped) {
    const Eye first = swapped ? Eye::Right : Eye::Left, second = swapped ? Eye::Left : Eye::Right;
    ASSERT_EQ(shown.geometry, (frames::FrameGeometry{.width = 2 * kWidth, .height = kHeight}));
    EXPECT_GT(decibels(shown, 0, first, frame), kLeastDecibels) << frame;
    EXPECT_GT(decibels(shown, kWidth, second, frame), kLeastDecibels) << frame;
  }

  /// Plays two rounds of the film, whose eyes must be right in each frame.
  void expect_film(const std::string& name, const std::string& bytes, bool swapped) const {
    VideoRequest wanted = views(name, bytes);
    wanted.plays_again = true;
    const auto source = open_video(wanted);
    for (int round = 0; round < 2; ++round) {
      for (uint64_t k = 0; k < kFrames; ++k) {
        frames::AcquiredFrame acquired;
        ASSERT_EQ(pull(*source, acquired), PullStatus::Ready) << source->failure();
        expect_eyes(acquired.frame, k, swapped);
        source->release(acquired.token);
      }
      expect_status(*source, PullStatus::End);
      ASSERT_TRUE(source->rewind());
    }
    EXPECT_FALSE(source->damage().any());
  }

  /// Decodes from frame 9, and seeks to the key frame at time 6.
  void expect_rest(const std::string& name, const std::string& bytes, bool swapped) const {
    const VideoRequest wanted = views(name, bytes);
    const auto ring =
        frames::RingPlayer::open({.socket = file("ring"),
                                  .geometry = {.width = 2 * kWidth, .height = kHeight},
                                  .slots = 4,
                                  .rig_fingerprint = {}});
    const test::BackgroundProcess decoder(
        {LENTICULE_VIDEO_PROGRAM, "decode", "--ring", file("ring").string(), "--from", "9",
         "--known-frame", "6", "--known-time=6", "--before-weaving", wanted.file.string()});
    for (uint64_t k = 9; k < kFrames; ++k) {
      frames::AcquiredFrame acquired;
      ASSERT_EQ(pull(*ring, acquired), PullStatus::Ready);
      expect_eyes(acquired.frame, k, swapped);
      ring->release(acquired.token);
    }
    expect_status(*ring, PullStatus::End);
  }

  /// Where FFmpeg decodes one view, that is played, and a message names the other one once.
  void expect_first_view_and_message(const std::string& warning) const {
    int major = 0, minor = 0;
    ASSERT_EQ(std::sscanf(warning.c_str(), "FFmpeg %d.%d", &major, &minor), 2) << warning;
    EXPECT_LT(std::pair(major, minor), std::pair(7, 1)) << "this FFmpeg decodes both views";
    EXPECT_THAT(warning, HasSubstr("the other eye of MV-HEVC"));
    EXPECT_THAT(warning, HasSubstr("play it on Debian 13"));
    const VideoRequest wanted = views("again.mp4", original());
    testing::internal::CaptureStderr();
    const auto source = open_video(wanted);
    (void)open_video(wanted);
    const std::string said = testing::internal::GetCapturedStderr();
    ASSERT_THAT(said, HasSubstr(warning));
    EXPECT_EQ(said.find(warning, said.find(warning) + 1), std::string::npos) << said;
    for (uint64_t k = 0; k < kFrames; ++k) {
      frames::AcquiredFrame acquired;
      ASSERT_EQ(pull(*source, acquired), PullStatus::Ready) << source->failure();
      ASSERT_EQ(acquired.frame.geometry, (frames::FrameGeometry{kWidth, kHeight}));
      EXPECT_GT(decibels(acquired.frame, 0, Eye::Left, k), kLeastDecibels) << k;
      source->release(acquired.token);
    }
    expect_status(*source, PullStatus::End);
  }
};

TEST_F(VideoOfTwoViews, BothEyesArePlayedOrAMessageNamesTheSecond) {
  const VideoRequest wanted = views("film.mp4", original());
  const VideoStream stream = probe_video(wanted.file, wanted.program).front();
  if (stream.views == 1) return expect_first_view_and_message(stream.warning);
  EXPECT_EQ(stream.warning, "");
  ASSERT_TRUE(stream.stereo.has_value());
  EXPECT_EQ(stream.stereo->layout, "side by side");
  EXPECT_FALSE(stream.stereo->right_first);
  expect_film("film.mp4", original(), false);
  expect_rest("film.mp4", original(), false);
  // The left view is number 1, the right one 0.
  const std::string swapped =
      changed(original(), kSei, std::string("\x4e\x01\xb0\x04\x04\x0a\x80\x10", 8));
  expect_film("swapped.mp4", swapped, true);
  expect_rest("swapped.mp4", swapped, true);
  // Without the message, the first view is for the left eye unless the container says otherwise.
  const std::string silent =
      changed(original(), kSei, std::string("\x4e\x01\xb1\x04\x04\x0d\x00\x10", 8));
  expect_film("silent.mp4", silent, false);
  const std::string reversed =
      changed(silent, std::string("stri\0\0\0\0\3", 9), std::string("stri\0\0\0\0\xb", 9));
  expect_film("reversed.mp4", reversed, true);
}

}  // namespace
}  // namespace lenticule::player
