// SPDX-License-Identifier: Apache-2.0
// Tests hardware decoders of videos with a fake device, which a preloaded library shows to the
// decoder. The device's pictures differ from those of the file, so that each
// shows which of the two made it.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/exit_code.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"
#include "tests/support/fakes/fake_v4l2_pictures.h"
#include "tests/support/h264_clip.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;
using nlohmann::json;
using Words = std::vector<std::string>;
using Pictures = std::vector<std::vector<uint8_t>>;

constexpr int kWidth = 64;
constexpr int kHeight = 48;
constexpr int kMilliseconds = 40;
constexpr size_t kFrames = 12;
constexpr size_t kAll = 1000;
constexpr const char* kNoDevice = "absent";
constexpr const char* kGood = "good";

/// Frames and messages of one run of lenticule-video decode.
struct Decoded {
  Pictures frames;
  int exit_code = -1;
  std::string messages;
  std::vector<json> choices;  ///< the events that name a decoder
};

class HardwareVideo : public test::VideoTest {
 protected:
  static test::Picture420 file_picture(size_t number, int height) {
    test::Picture420 picture{.width = kWidth, .height = height, .samples = {}};
    const size_t luma = size_t{kWidth} * static_cast<size_t>(height);
    for (size_t i = 0; i < luma * 3 / 2; ++i)
      picture.samples.push_back(
          static_cast<uint8_t>(40 + (i * 7 + i / kWidth + number * 31) % 150));
    return picture;
  }

  static test::Picture420 device_picture(size_t number, int height) {
    test::Picture420 picture{.width = kWidth, .height = height, .samples = {}};
    const size_t luma = size_t{kWidth} * static_cast<size_t>(height);
    picture.samples.assign(luma, test::brightness_of_fake_picture(number));
    picture.samples.insert(picture.samples.end(), luma / 4, test::kFakeBlue);
    picture.samples.insert(picture.samples.end(), luma / 4, test::kFakeRed);
    return picture;
  }

  std::filesystem::path clip(int height = kHeight, bool full_range = false) const {
    return write("clip.flv", height, full_range, file_picture);
  }
  /// Returns a clip whose pictures between key frames are copies.
  std::filesystem::path clip_of_copies(unsigned key_interval) const {
    return write("copies.flv", kHeight, false, file_picture, key_interval);
  }

  /// Returns the frames that software shows of the file.
  Pictures of_file(int height = kHeight) const {
    return decode(kNoDevice, write("file.flv", height, false, file_picture), {}, kAll, height)
        .frames;
  }
  /// Returns the frames that software shows of a file with the device's pictures.
  Pictures of_device(int height = kHeight, bool full_range = false) const {
    return decode(kNoDevice, write("device.flv", height, full_range, device_picture), {}, kAll,
                  height)
        .frames;
  }

  /// Decodes at most `most` frames with the device that the words describe.
  Decoded decode(const std::string& device, const std::filesystem::path& file,
                 const Words& flags = {}, size_t most = kAll, int height = kHeight,
                 bool before_weaving = true) const {
    auto ring = frames::RingPlayer::open(
        {.socket = folder / "ring",
         .geometry = {.width = file.extension() == ".mkv" ? kSmall.width : kWidth,
                      .height = file.extension() == ".mkv" ? kSmall.height : height},
         .slots = 4,
         .rig_fingerprint = {}});
    Words words = {"/usr/bin/env",
                   std::string("LD_PRELOAD=") + LENTICULE_FAKE_V4L2,
                   "LENTICULE_FAKE_DECODER=" + device,
                   LENTICULE_VIDEO_PROGRAM,
                   "decode",
                   "--ring",
                   (folder / "ring").string()};
    if (before_weaving) words.emplace_back("--before-weaving");
    words.insert(words.end(), flags.begin(), flags.end());
    words.push_back(file.string());
    test::BackgroundProcess process(words);
    Decoded decoded;
    decoded.frames = take_frames(*ring, process.pid(), most);
    ring.reset();
    const test::ProcessResult result = process.wait(test::kVideoDeadline);
    decoded.exit_code = result.exit_code;
    decoded.messages = result.err;
    decoded.choices = choices_in(result.err);
    return decoded;
  }

  /// Expects the device's pictures up to `change` and then those of the file.
  static void expect_change(const Pictures& shown, const Pictures& device, const Pictures& file,
                            size_t change) {
    ASSERT_EQ(shown.size(), file.size());
    for (size_t k = 0; k < shown.size(); ++k)
      EXPECT_EQ(shown[k], k < change ? device[k] : file[k]) << "frame " << k;
  }

 private:
  template <typename Draw>
  std::filesystem::path write(const std::string& name, int height, bool full_range,
                              const Draw& draw, unsigned key_interval = 1) const {
    std::vector<test::Picture420> pictures;
    for (size_t k = 0; k < kFrames; ++k) pictures.push_back(draw(k, height));
    test::write_h264_clip({.file = file(name),
                           .milliseconds = kMilliseconds,
                           .key_interval = key_interval,
                           .full_range = full_range},
                          pictures);
    return file(name);
  }

  static bool has_ended(pid_t process) {
    siginfo_t info{};
    return waitid(P_PID, static_cast<id_t>(process), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == process;
  }

  static Pictures take_frames(frames::RingPlayer& ring, pid_t process, size_t most) {
    const auto deadline = std::chrono::steady_clock::now() + test::kVideoDeadline;
    Pictures taken;
    while (taken.size() < most && std::chrono::steady_clock::now() < deadline) {
      const bool last = has_ended(process);
      ring.service();
      frames::AcquiredFrame frame;
      const PullStatus status = ring.pull(frame);
      if (status == PullStatus::End || (status == PullStatus::NotYet && last)) return taken;
      if (status == PullStatus::NotYet) {
        pollfd wake{.fd = ring.wake_fd(), .events = POLLIN, .revents = 0};
        (void)poll(&wake, 1, 20);
        continue;
      }
      EXPECT_EQ(frames::position_of(frame.number), taken.size());
      taken.emplace_back(frame.frame.bytes.begin(), frame.frame.bytes.end());
      ring.release(frame.token);
    }
    return taken;
  }

  static std::vector<json> choices_in(const std::string& messages) {
    std::vector<json> choices;
    std::istringstream lines(messages);
    for (std::string line; std::getline(lines, line);) {
      const json event = json::parse(line, nullptr, false);
      if (event.is_object() && event.value("event", "") == "decoder") choices.push_back(event);
    }
    return choices;
  }
};

TEST_F(HardwareVideo, TheDeviceDecodesEveryPictureOfAStream) {
  const Decoded decoded = decode(kGood, clip());
  EXPECT_EQ(decoded.exit_code, kOk) << decoded.messages;
  EXPECT_EQ(decoded.frames.size(), kFrames);
  EXPECT_EQ(decoded.frames, of_device());
  ASSERT_EQ(decoded.choices.size(), 1u) << decoded.messages;
  EXPECT_EQ(decoded.choices[0]["decoder"], "h264_v4l2m2m");
  EXPECT_EQ(decoded.choices[0]["hardware"], true);
  EXPECT_EQ(decoded.choices[0]["reason"], "");
}

TEST_F(HardwareVideo, InterleavedChromaGivesTheSamePictures) {
  EXPECT_EQ(decode("nv12", clip()).frames, of_device());
}

TEST_F(HardwareVideo, TheColoursAreThoseThatTheStreamStates) {
  EXPECT_EQ(decode(kGood, clip(kHeight, true)).frames, of_device(kHeight, true));
  EXPECT_NE(of_device(kHeight, true), of_device(kHeight, false));
}

TEST_F(HardwareVideo, RowsThatFillTheLastBlocksAreLeftOut) {
  constexpr int kUneven = 40;
  for (const char* const device : {"whole-blocks", "whole-blocks nv12"}) {
    const Decoded decoded = decode(device, clip(kUneven), {}, kAll, kUneven);
    EXPECT_EQ(decoded.frames.size(), kFrames);
    EXPECT_EQ(decoded.frames, of_device(kUneven)) << decoded.messages;
  }
}

TEST_F(HardwareVideo, TheConfinedDecoderOpensTheDeviceAgainForEveryRound) {
  constexpr size_t kRounds = 5;
  const Pictures device = of_device();
  const Decoded decoded = decode(kGood, clip(), {"--loop"}, kRounds * kFrames);
  ASSERT_EQ(decoded.frames.size(), kRounds * kFrames) << decoded.messages;
  for (size_t k = 0; k < decoded.frames.size(); ++k)
    EXPECT_EQ(decoded.frames[k], device[k % kFrames]) << "frame " << k;
  EXPECT_EQ(decoded.choices.size(), 1u) << decoded.messages;
}

TEST_F(HardwareVideo, ADeviceThatCannotBeOpenedAgainIsReplacedInTheNextRound) {
  const Pictures device = of_device();
  const Pictures file = of_file();
  const Decoded decoded = decode("opens=1", clip(), {"--loop"}, 2 * kFrames);
  ASSERT_EQ(decoded.frames.size(), 2 * kFrames) << decoded.messages;
  for (size_t k = 0; k < kFrames; ++k) {
    EXPECT_EQ(decoded.frames[k], device[k]) << "frame " << k;
    EXPECT_EQ(decoded.frames[kFrames + k], file[k]) << "frame " << k;
  }
}

TEST_F(HardwareVideo, SoftwareShowsTheFileWhenTheDeviceIsOfNoUse) {
  const Pictures file = of_file();
  for (const char* const device : {"refuses-format", "eats", "small", "short-buffers", "error-at=0",
                                   "grows-at=0", "refuses-packet=0", "opens=0"}) {
    const Decoded decoded = decode(device, clip());
    EXPECT_EQ(decoded.exit_code, kOk) << device << ": " << decoded.messages;
    EXPECT_EQ(decoded.frames, file) << device;
    ASSERT_FALSE(decoded.choices.empty()) << device;
    EXPECT_LE(decoded.choices.size(), 2u) << device;
    EXPECT_EQ(decoded.choices.back()["hardware"], false) << device;
    EXPECT_NE(decoded.choices.back()["reason"], "") << device;
  }
}

TEST_F(HardwareVideo, ADecoderWhoseDeviceFailsAfterItsFirstPictureEnds) {
  const Pictures device = of_device();
  for (const char* const fault : {"error-at=5", "grows-at=5", "refuses-packet=5"}) {
    const Decoded decoded = decode(fault, clip());
    EXPECT_EQ(decoded.exit_code, kDevice) << fault << ": " << decoded.messages;
    EXPECT_EQ(decoded.frames, Pictures(device.begin(), device.begin() + 5)) << fault;
    ASSERT_EQ(decoded.choices.size(), 2u) << fault << ": " << decoded.messages;
    EXPECT_THAT(decoded.choices[1]["reason"].get<std::string>(),
                testing::StartsWith("hardware decoder failed: "));
  }
}

TEST_F(HardwareVideo, ADecoderWhoseDeviceDoesNotAnswerEnds) {
  const Pictures device = of_device();
  for (const size_t answers : {size_t{0}, size_t{4}}) {
    const Decoded decoded = decode("hangs-at=" + std::to_string(answers), clip());
    EXPECT_EQ(decoded.exit_code, kDevice) << decoded.messages;
    EXPECT_EQ(decoded.frames, Pictures(device.begin(), device.begin() + ptrdiff_t(answers)));
    EXPECT_THAT(decoded.messages, testing::HasSubstr("h264_v4l2m2m does not answer"));
    EXPECT_THAT(decoded.messages, testing::HasSubstr("use --decoder software"));
  }
}

TEST_F(HardwareVideo, OnlyADecoderWithADeviceMayOpenDescriptors) {
  const auto source = [this](const char* device) {
    setenv("LD_PRELOAD", LENTICULE_FAKE_V4L2, 1);
    setenv("LENTICULE_FAKE_DECODER", device, 1);
    VideoRequest wanted = request(clip());
    wanted.before_weaving = wanted.plays_again = wanted.hardware = true;
    std::unique_ptr<VideoSource> opened = open_video(wanted);
    frames::AcquiredFrame frame;
    EXPECT_EQ(pull(*opened, frame), PullStatus::Ready) << opened->failure();
    opened->release(frame.token);
    unsetenv("LD_PRELOAD");
    return opened;
  };
  const auto read = [](const VideoSource& playing, const char* name) {
    return test::read_text(fmt::format("/proc/{}/{}", playing.statistics().decoder, name));
  };
  const auto hardware = source(kGood);
  EXPECT_THAT(read(*hardware, "status"), testing::HasSubstr("Seccomp:\t2"));
  EXPECT_THAT(read(*hardware, "status"), testing::HasSubstr("NoNewPrivs:\t1"));
  EXPECT_THAT(read(*hardware, "limits"),
              testing::ContainsRegex("Max open files +([2-9]|[1-9][0-9]) "));
  EXPECT_THAT(read(*hardware, "limits"), testing::ContainsRegex("Max file size +0 "));
  const auto software = source(kNoDevice);
  EXPECT_THAT(read(*software, "limits"), testing::ContainsRegex("Max open files +1 "));
}

/// A device begins anew after a seek: its picture 0 is the frame that was sought.
TEST_F(HardwareVideo, ASeekBeginsAnew) {
  const Words from = {"--from", "7", "--known-frame", "4", "--known-time=160"};
  const Pictures device = of_device();
  const Pictures file = of_file();
  const Pictures whole = decode(kGood, clip(), from).frames;
  ASSERT_EQ(whole.size(), kFrames - 7);
  for (size_t k = 7; k < kFrames; ++k) EXPECT_EQ(whole[k - 7], device[k - 4]) << "frame " << k;
  // A device that gives no picture is replaced where it had begun.
  const Pictures replaced = decode("eats", clip(), from).frames;
  EXPECT_EQ(replaced, Pictures(file.begin() + 7, file.end()));
}

/// Copied from the middle of a group of pictures: the frames before it are decoded and not shown.
TEST_F(HardwareVideo, FramesThatAnEditListHidesAreNotShown) {
  const std::string whole = clip_of_copies(6).string();
  ffmpeg("-i " + whole + " -c copy whole.mp4");
  ffmpeg("-ss 0.36 -i whole.mp4 -c copy cut.mp4");
  const size_t shown = decode(kNoDevice, file("cut.mp4")).frames.size();
  ASSERT_LT(shown, 6u);
  const Pictures device = of_device();
  EXPECT_EQ(decode(kGood, file("cut.mp4")).frames,
            Pictures(device.begin() + ptrdiff_t(6 - shown), device.begin() + 6));
}

TEST_F(HardwareVideo, DecoderSoftwareOpensNoDevice) {
  const Decoded decoded = decode(kGood, clip(), {"--decoder", "software"});
  EXPECT_EQ(decoded.frames, of_file());
  EXPECT_TRUE(decoded.choices.empty());
}

TEST_F(HardwareVideo, DecoderHardwareRefusesSoftware) {
  const Words hardware = {"--decoder", "hardware"};
  EXPECT_EQ(decode(kGood, clip(), hardware).frames, of_device());
  for (const char* const device : {kNoDevice, "camera", "small", "refuses-format", "error-at=3"}) {
    const Decoded decoded = decode(device, clip(), hardware);
    EXPECT_EQ(decoded.exit_code, kDevice) << device;
    EXPECT_THAT(decoded.messages, testing::HasSubstr("clip.flv: not decoded in hardware: "));
    EXPECT_THAT(decoded.messages, testing::HasSubstr("use --decoder software"));
  }
  const Decoded woven = decode(kGood, clip(), hardware, kAll, kHeight, false);
  EXPECT_EQ(woven.exit_code, kDevice) << woven.messages;
}

TEST_F(HardwareVideo, OtherStreamsAreDecodedInSoftware) {
  const Decoded decoded = decode(kGood, write_clip("clip.mkv", 3));
  ASSERT_EQ(decoded.frames.size(), 3u) << decoded.messages;
  for (size_t k = 0; k < 3; ++k)
    EXPECT_TRUE(std::ranges::equal(decoded.frames[k], clip_frame(k).bytes()));
  ASSERT_EQ(decoded.choices.size(), 1u);
  EXPECT_EQ(decoded.choices[0]["reason"], "ffv1 is not decoded in hardware");
}

// --- with the player's source -------------------------------------------------------------------

class HardwareSource : public HardwareVideo {
 protected:
  /// Children inherit the environment; the test itself keeps the real devices.
  void SetUp() override {
    HardwareVideo::SetUp();
    setenv("LD_PRELOAD", LENTICULE_FAKE_V4L2, 1);
  }
  void TearDown() override {
    unsetenv("LD_PRELOAD");
    unsetenv("LENTICULE_FAKE_DECODER");
    HardwareVideo::TearDown();
  }

  static Pictures play(VideoSource& source) {
    Pictures shown;
    frames::AcquiredFrame frame;
    while (pull(source, frame) == PullStatus::Ready) {
      shown.emplace_back(frame.frame.bytes.begin(), frame.frame.bytes.end());
      source.release(frame.token);
    }
    return shown;
  }

  std::unique_ptr<VideoSource> open(const std::string& device, bool hardware = true) const {
    return open(device, clip(), hardware);
  }
  std::unique_ptr<VideoSource> open(const std::string& device, const std::filesystem::path& film,
                                    bool hardware = true) const {
    setenv("LENTICULE_FAKE_DECODER", device.c_str(), 1);
    VideoRequest wanted = request(film);
    wanted.before_weaving = true;
    wanted.hardware = hardware;
    return open_video(wanted);
  }
};

TEST_F(HardwareSource, PlaysWhatTheDeviceDecodes) {
  const Pictures device = of_device();
  const auto source = open(kGood);
  EXPECT_EQ(play(*source), device) << source->failure();
  EXPECT_EQ(source->video_decoder(), "h264_v4l2m2m");
  EXPECT_EQ(source->statistics().restarts, 0u);
}

TEST_F(HardwareSource, ContinuesInSoftwareAfterADeviceThatDoesNotAnswer) {
  const Pictures file = of_file();
  const Pictures device = of_device();
  const auto source = open("hangs-at=4");
  expect_change(play(*source), device, file, 4);
  EXPECT_EQ(source->statistics().restarts, 1u);
  EXPECT_EQ(source->video_decoder(), "software: hardware decoder h264_v4l2m2m does not answer");
}

TEST_F(HardwareSource, UsesNoDeviceIfNotWanted) {
  const Pictures file = of_file();
  const auto source = open(kGood, false);
  EXPECT_EQ(play(*source), file);
  EXPECT_EQ(source->video_decoder(), "");
}

/// In a process of its own, because the player remembers the failures as long as it runs.
TEST_F(HardwareSource, UsesNoDeviceAfterThreeFailures) {
  const Pictures file = of_file();
  const Pictures device = of_device();
  const pid_t child = fork();
  if (child == 0) {
    expect_change(play(*open("crashes-at=2")), device, file, 2);
    // The third failure is one of these if another test of this program has had one.
    for (int more = 0; more < 2; ++more) EXPECT_EQ(play(*open("crashes-at=2")).size(), kFrames);
    EXPECT_EQ(play(*open(kGood)), file);
    _exit(HasFailure() ? 1 : 0);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST_F(HardwareSource, SoftwareContinuesWithThePictureThatTheDeviceFailsToGive) {
  const std::filesystem::path film = clip_of_copies(5);
  const Pictures device = of_device();
  const Pictures copies = decode(kNoDevice, film).frames;
  ASSERT_EQ(copies.size(), kFrames);
  EXPECT_EQ(copies[4], copies[0]);
  EXPECT_NE(copies[5], copies[4]);
  for (const size_t fault : {6, 9})
    expect_change(play(*open("error-at=" + std::to_string(fault), film)), device, copies, fault);
}

// --- with the command ---------------------------------------------------------------------------

TEST_F(HardwareVideo, PlayNamesTheDecoder) {
  const std::filesystem::path film = file("film_qs2x1a0.75.flv");
  std::filesystem::copy_file(clip(), film);
  const auto play = [&](const char* device, const Words& flags) {
    Words words = {"/usr/bin/env",
                   std::string("LD_PRELOAD=") + LENTICULE_FAKE_V4L2,
                   std::string("LENTICULE_FAKE_DECODER=") + device,
                   LENTICULE_PROGRAM,
                   "play",
                   film.string(),
                   "--rig",
                   LENTICULE_SOURCE_DIR "/scenes/rigs/tiny.toml",
                   "--display",
                   "virtual",
                   "--clock",
                   "simulated",
                   "--json"};
    words.insert(words.end(), flags.begin(), flags.end());
    const test::ProcessResult result = test::run_process(words);
    EXPECT_EQ(result.exit_code, kOk) << result.err;
    json statistics = json::parse(result.out, nullptr, false);
    EXPECT_EQ(statistics["shown"], kFrames);
    return statistics;
  };
  EXPECT_EQ(play(kGood, {})["video_decoder"], "h264_v4l2m2m");
  EXPECT_EQ(play("error-at=2", {})["video_decoder"],
            "software: hardware decoder failed: it reports a damaged picture");
  EXPECT_FALSE(play(kNoDevice, {}).contains("video_decoder"));
  EXPECT_FALSE(play(kGood, {"--video-decoder", "software"}).contains("video_decoder"));
}

}  // namespace
}  // namespace lenticule::player
