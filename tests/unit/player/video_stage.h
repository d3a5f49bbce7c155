// SPDX-License-Identifier: Apache-2.0
// Makes clips for tests of video files, and pulls frames with a deadline.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "apps/lenticule-tools/offline/video_writer.h"
#include "player/sources/video_source.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {

/// A timeout far beyond every test's needs: a test that reaches it hangs.
inline constexpr std::chrono::seconds kVideoDeadline{60};

inline std::vector<uint8_t> random_bytes(size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<uint8_t> bytes(count);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

class VideoTest : public testing::Test {
 protected:
  ScratchFolder scratch;
  std::filesystem::path folder = scratch.path();
  static constexpr frames::FrameGeometry kSmall{.width = 34, .height = 22};

  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder / name; }

  /// Returns frame k of every clip that write_clip() makes.
  [[nodiscard]] static frames::WovenFrame clip_frame(uint64_t k) {
    frames::WovenFrame frame(kSmall);
    std::ranges::copy(random_bytes(kSmall.frame_bytes(), static_cast<unsigned>(k) + 1),
                      frame.bytes().begin());
    return frame;
  }

  [[nodiscard]] std::filesystem::path write_clip(
      const std::string& name, uint64_t frames,
      tools::VideoCodec codec = tools::VideoCodec::Ffv1) const {
    tools::VideoWriter writer({.file = file(name),
                               .geometry = kSmall,
                               .rate = {24000, 1001},
                               .codec = codec,
                               .program = LENTICULE_VIDEO_PROGRAM});
    for (uint64_t k = 0; k < frames; ++k) writer.write(clip_frame(k).view());
    writer.finish();
    return file(name);
  }

  /// Runs the program ffmpeg in the test's folder.
  void ffmpeg(const std::string& words) const {
    const ProcessResult result = run_process(
        {"/bin/sh", "-c",
         fmt::format("cd {} && exec ffmpeg -v error -nostdin -y {}", folder.string(), words)});
    ASSERT_EQ(result.exit_code, 0) << "ffmpeg " << words << "\n" << result.err;
  }

  /// Encodes one frame of FFmpeg's pixel format with FFV1. `tags` are options of ffmpeg, for
  /// example "-color_range pc", or empty.
  [[nodiscard]] std::filesystem::path encode(const std::string& name, int width, int height,
                                             const std::vector<uint8_t>& raw,
                                             const std::string& pixels,
                                             const std::string& tags) const {
    write_bytes(file(name + ".raw"), raw);
    ffmpeg(
        fmt::format("-f rawvideo -pixel_format {} -video_size {}x{} -i {}.raw -c:v ffv1 plain-{}",
                    pixels, width, height, name, name));
    // Set on the encoder, a full range would make FFmpeg 7 convert the samples.
    ffmpeg(fmt::format("-i plain-{} -c copy {} {}", name, tags, name));
    return file(name);
  }

  [[nodiscard]] static player::VideoRequest request(const std::filesystem::path& clip) {
    return {.file = clip, .program = LENTICULE_VIDEO_PROGRAM};
  }

  /// Returns the next status other than NotYet; NotYet after the deadline.
  [[nodiscard]] static frames::PullStatus pull(frames::FrameSource& source,
                                               frames::AcquiredFrame& out) {
    const auto deadline = std::chrono::steady_clock::now() + kVideoDeadline;
    frames::PullStatus status = source.pull(out);
    while (status == frames::PullStatus::NotYet && std::chrono::steady_clock::now() < deadline) {
      pollfd wake{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
      (void)poll(&wake, 1, 20);
      source.service();
      status = source.pull(out);
    }
    return status;
  }

  static void expect_frame(frames::FrameSource& source, uint64_t k) {
    frames::AcquiredFrame acquired;
    ASSERT_EQ(pull(source, acquired), frames::PullStatus::Ready) << k << ": " << source.failure();
    EXPECT_EQ(acquired.number, k);
    EXPECT_TRUE(std::ranges::equal(acquired.frame.bytes, clip_frame(k).bytes())) << "frame " << k;
    source.release(acquired.token);
  }

  static void expect_status(frames::FrameSource& source, frames::PullStatus status) {
    frames::AcquiredFrame acquired;
    EXPECT_EQ(pull(source, acquired), status) << source.failure();
  }

  /// Returns the first frame of a clip.
  [[nodiscard]] static std::vector<uint8_t> first_frame(const player::VideoRequest& wanted) {
    const auto source = player::open_video(wanted);
    frames::AcquiredFrame acquired;
    EXPECT_EQ(pull(*source, acquired), frames::PullStatus::Ready) << source->failure();
    return {acquired.frame.bytes.begin(), acquired.frame.bytes.end()};
  }
};

}  // namespace lenticule::test
