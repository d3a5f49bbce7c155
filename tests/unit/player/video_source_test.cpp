// SPDX-License-Identifier: Apache-2.0
// Tests video files as frame sources: frames come in order, each once, also if the decoder process
// dies.
#include "player/sources/video_source.h"

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cerrno>
#include <csignal>

#include "base/error.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;
using namespace std::chrono_literals;

class VideoPlays : public test::VideoTest {
 protected:
  /// Waits until a decoder runs and sends a signal to it.
  static void strike(VideoSource& source, int signal) {
    const auto deadline = std::chrono::steady_clock::now() + test::kVideoDeadline;
    while (source.statistics().decoder <= 0) {
      ASSERT_LT(std::chrono::steady_clock::now(), deadline);
      ASSERT_EQ(source.failure(), "");
      source.service();
    }
    ASSERT_EQ(::kill(static_cast<pid_t>(source.statistics().decoder), signal), 0);
  }

  static std::string refusal(const VideoRequest& wanted, ErrorKind kind = ErrorKind::Input) {
    const Error error = test::error_of([&] { (void)open_video(wanted); });
    EXPECT_EQ(error.kind(), kind);
    return error.what();
  }
};

TEST_F(VideoPlays, EveryFrameOnceAndExactlyThenTheEnd) {
  for (const tools::VideoCodec codec : {tools::VideoCodec::Ffv1, tools::VideoCodec::X264Rgb}) {
    const auto source = open_video(request(write_clip("clip.mkv", 12, codec)));
    EXPECT_EQ(source->geometry(), kSmall);
    EXPECT_EQ(source->rate(), (frames::Rate{24000, 1001}));
    for (uint64_t k = 0; k < 12; ++k) expect_frame(*source, k);
    expect_status(*source, PullStatus::End);
    expect_status(*source, PullStatus::End);
    EXPECT_EQ(source->frame_count(), 12u);
  }
}

TEST_F(VideoPlays, ARangeOfFrames) {
  VideoRequest wanted = request(write_clip("clip.mkv", 9));
  wanted.frames = FrameRange{3, 7};
  const auto source = open_video(wanted);
  for (uint64_t k = 0; k < 4; ++k) {
    frames::AcquiredFrame acquired;
    ASSERT_EQ(pull(*source, acquired), PullStatus::Ready);
    EXPECT_TRUE(std::ranges::equal(acquired.frame.bytes, clip_frame(k + 3).bytes()));
    source->release(acquired.token);
  }
  expect_status(*source, PullStatus::End);
}

TEST_F(VideoPlays, LoopsWithoutARepeatedOrLostFrame) {
  VideoRequest wanted = request(write_clip("clip.mkv", 3));
  wanted.plays_again = true;
  const auto source = open_video(wanted);
  for (int loop = 0; loop < 200; ++loop) {
    for (uint64_t k = 0; k < 3; ++k) expect_frame(*source, k);
    expect_status(*source, PullStatus::End);
    ASSERT_TRUE(source->rewind());
  }
  EXPECT_EQ(source->statistics().restarts, 0u);
}

TEST_F(VideoPlays, RewindsWithANewDecoderIfNoLoopWasRequested) {
  const auto source = open_video(request(write_clip("clip.mkv", 3)));
  for (int loop = 0; loop < 3; ++loop) {
    for (uint64_t k = 0; k < 3; ++k) expect_frame(*source, k);
    expect_status(*source, PullStatus::End);
    ASSERT_TRUE(source->rewind());
  }
  EXPECT_EQ(source->statistics().restarts, 0u);
}

TEST_F(VideoPlays, ContinuesAfterADecoderWasKilledOrStopped) {
  const auto clip = write_clip("clip.mkv", 40);
  for (const int signal : {SIGKILL, SIGSTOP, SIGSEGV}) {
    VideoRequest wanted = request(clip);
    if (signal == SIGSTOP) wanted.timeout = 1000ms;
    const auto source = open_video(wanted);
    for (uint64_t k = 0; k < 40; ++k) {
      if (k == 5 || k == 21) strike(*source, signal);
      expect_frame(*source, k);
    }
    expect_status(*source, PullStatus::End);
    EXPECT_GE(source->statistics().restarts, 1u);
    EXPECT_EQ(source->statistics().hangs > 0, signal == SIGSTOP);
  }
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);  // no zombie
  EXPECT_EQ(errno, ECHILD);
}

TEST_F(VideoPlays, ContinuesInALoopOfUnknownLength) {
  const auto clip = write_clip("clip.mkv", 5);
  for (uint64_t strike_at = 0; strike_at < 8; strike_at += 3) {
    VideoRequest wanted = request(clip);
    wanted.plays_again = true;
    const auto source = open_video(wanted);
    for (uint64_t k = 0; k < 25; ++k) {
      if (k > 0 && k % 5 == 0) {
        expect_status(*source, PullStatus::End);
        ASSERT_TRUE(source->rewind());
      }
      if (k == strike_at) strike(*source, SIGKILL);
      expect_frame(*source, k % 5);
    }
    EXPECT_EQ(source->statistics().restarts, 1u);
  }
}

TEST_F(VideoPlays, GivesUpAfterTheFourthDeathWithinAMinute) {
  VideoRequest wanted = request(write_clip("clip.mkv", 3));
  wanted.plays_again = true;
  testing::internal::CaptureStderr();
  const auto source = open_video(wanted);
  frames::AcquiredFrame acquired;
  PullStatus status = PullStatus::NotYet;
  for (int frame = 0; frame < 100000 && status != PullStatus::Failed; ++frame) {
    if (source->statistics().decoder > 0 && frame % 4 == 0)
      ::kill(static_cast<pid_t>(source->statistics().decoder), SIGKILL);
    status = pull(*source, acquired);
    if (status == PullStatus::Ready) source->release(acquired.token);
    if (status == PullStatus::End) {
      ASSERT_TRUE(source->rewind());
    }
  }
  EXPECT_EQ(status, PullStatus::Failed);
  EXPECT_EQ(source->statistics().restarts, 3u);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              testing::HasSubstr("the decoder ended: killed by signal 9; another one continues, "
                                 "restart 3"));
  EXPECT_THAT(source->failure(), testing::HasSubstr("signal 9"));
}

TEST_F(VideoPlays, RefusesFilesThatAreNotVideos) {
  for (const auto& [content, what] :
       {std::pair("", "words.mkv: empty"),
        {"these are words, not pictures\n", "words.mkv: a text, not the file"},
        {"<!DOCTYPE html>\n<html>", "words.mkv: a page of the web"},
        {"version https://git-lfs.github.com/spec/v1\n", "words.mkv: a pointer of Git LFS"},
        {"\x01\x02", "words.mkv: not a readable video"}}) {
    std::ofstream(file("words.mkv"), std::ios::trunc) << content;
    EXPECT_THAT(refusal(request(file("words.mkv"))), testing::HasSubstr(what));
  }
  EXPECT_THAT(refusal(request(file("absent.mkv"))), testing::HasSubstr("No such file"));
  EXPECT_THAT(refusal(request(folder)), testing::HasSubstr("not a regular file"));
}

TEST_F(VideoPlays, RefusesImpossibleSizes) {
  std::ofstream(file("huge.y4m")) << "YUV4MPEG2 W100000 H100000 F25:1 Ip C444\nFRAME\n";
  (void)refusal(request(file("huge.y4m")));
  std::ofstream(file("large.y4m")) << "YUV4MPEG2 W32768 H32768 F25:1 Ip C444\nFRAME\n";
  (void)refusal(request(file("large.y4m")));
}

TEST_F(VideoPlays, ReportsAMissingStream) {
  VideoRequest wanted = request(write_clip("clip.mkv", 1));
  wanted.stream = 3;
  EXPECT_THAT(refusal(wanted, ErrorKind::Usage), testing::HasSubstr("stream 3"));
}

/// Returns the number of damaged clips; LENTICULE_DAMAGED_CLIPS=400 makes a longer run by hand.
int damaged_clips() {
  const char* const wanted = std::getenv("LENTICULE_DAMAGED_CLIPS");
  return wanted != nullptr ? std::atoi(wanted) : 24;
}

TEST_F(VideoPlays, DamagedFilesEndOrFailAndNeverHang) {
  const std::vector<uint8_t> clip = test::read_bytes(write_clip("whole.mkv", 6));
  std::mt19937 random(11);
  for (int i = 0; i < damaged_clips(); ++i) {
    std::vector<uint8_t> bytes = clip;
    const size_t place = random() % (i % 3 == 0 ? 600 : bytes.size());
    if (i % 2 == 0) bytes.resize(place);
    if (i % 2 == 1) bytes[place] ^= static_cast<uint8_t>(1 + random() % 255);
    test::write_bytes(file("damaged.mkv"), bytes);
    try {
      const auto source = open_video(request(file("damaged.mkv")));
      PullStatus status = PullStatus::Ready;
      for (int frame = 0; frame < 1000 && status == PullStatus::Ready; ++frame) {
        frames::AcquiredFrame acquired;
        status = pull(*source, acquired);
        if (status == PullStatus::Ready) source->release(acquired.token);
      }
      EXPECT_TRUE(status == PullStatus::End || status == PullStatus::Failed) << "place " << place;
    } catch (const Error& error) {
      EXPECT_NE(error.kind(), ErrorKind::Usage) << error.what();
    }
  }
}

TEST_F(VideoPlays, ADamagedFrameIsLeftOutAndCounted) {
  constexpr uint64_t kFrames = 6;
  const std::vector<uint8_t> clip = test::read_bytes(write_clip("whole.mkv", kFrames));
  uint64_t all_damaged = 0;
  for (size_t place = 1000; place + 500 < clip.size(); place += clip.size() / 16) {
    std::vector<uint8_t> bytes = clip;
    bytes[place] ^= 0xff;
    test::write_bytes(file("damaged.mkv"), bytes);
    const auto source = open_video(request(file("damaged.mkv")));
    uint64_t next = 0, shown = 0;
    frames::AcquiredFrame acquired;
    while (pull(*source, acquired) == PullStatus::Ready) {
      if (acquired.repeats) {  // in the place of the damaged one
        source->release(acquired.token);
        continue;
      }
      ++shown;
      while (next < kFrames && !std::ranges::equal(acquired.frame.bytes, clip_frame(next).bytes()))
        ++next;
      EXPECT_LT(next++, kFrames) << "frame " << shown << " is none of the clip, place " << place;
      source->release(acquired.token);
    }
    const frames::FrameDamage damage = source->damage();
    EXPECT_EQ(damage.damaged + damage.missing, kFrames - shown) << "place " << place;
    all_damaged += damage.damaged;
  }
  EXPECT_GT(all_damaged, 5u);
}

/// Not in sanitizer builds, since a sanitizer needs system calls of its own.
TEST_F(VideoPlays, TheDecoderIsSandboxed) {
  VideoRequest wanted = request(write_clip("clip.mkv", 3));
  wanted.plays_again = true;
  const auto source = open_video(wanted);
  expect_frame(*source, 0);
  const std::string process = fmt::format("/proc/{}", source->statistics().decoder);
  const auto read = [&process](const char* name) { return test::read_text(process + name); };
  const int filtered = LENTICULE_VIDEO_SANITIZED ? 0 : 2;
  EXPECT_THAT(read("/status"), testing::HasSubstr(fmt::format("Seccomp:\t{}", filtered)));
  if (LENTICULE_VIDEO_SANITIZED) return;
  EXPECT_THAT(read("/status"), testing::HasSubstr("NoNewPrivs:\t1"));
  EXPECT_THAT(read("/limits"), testing::ContainsRegex("Max open files +1 "));
  EXPECT_THAT(read("/limits"), testing::ContainsRegex("Max file size +0 "));
  EXPECT_THAT(read("/limits"), testing::ContainsRegex("Max core file size +0 "));
}

/// A decoder that starts where another one stopped, with a time stamp that may be wrong.
class VideoResumes : public VideoPlays {
 protected:
  void expect_from(uint64_t from, const std::filesystem::path& clip, const std::string& time) {
    const auto ring = frames::RingPlayer::open(
        {.socket = file("ring"), .geometry = kSmall, .slots = 4, .rig_fingerprint = {}});
    const test::BackgroundProcess decoder({LENTICULE_VIDEO_PROGRAM, "decode", "--ring",
                                           file("ring").string(), "--from", std::to_string(from),
                                           "--position", "100", "--known-frame", "20",
                                           "--known-time=" + time, clip.string()});
    for (uint64_t k = from; k < 40; ++k) {
      frames::AcquiredFrame acquired;
      ASSERT_EQ(pull(*ring, acquired), PullStatus::Ready);
      EXPECT_EQ(frames::position_of(acquired.number), 100 + k - from);
      EXPECT_TRUE(std::ranges::equal(acquired.frame.bytes, clip_frame(k).bytes())) << k;
      ring->release(acquired.token);
    }
    expect_status(*ring, PullStatus::End);
  }
};

TEST_F(VideoResumes, AtTheExactFrameForAnyTimeStamp) {
  for (const tools::VideoCodec codec : {tools::VideoCodec::Ffv1, tools::VideoCodec::X264Rgb}) {
    const auto clip = write_clip("clip.mkv", 40, codec);
    // Matroska counts milliseconds: 20 * 1001 / 24 = 834.2
    for (const char* time : {"834", "835", "-5", "99999999"}) {
      expect_from(20, clip, time);
      expect_from(31, clip, time);
    }
  }
}

// --- with a fake decoder ----------------------------------------------------------------------

class FakeVideo : public VideoPlays {
 protected:
  [[nodiscard]] std::unique_ptr<VideoSource> open(const std::string& what, bool plays_again) const {
    return open_video(
        {.file = file(what), .plays_again = plays_again, .program = LENTICULE_FAKE_VIDEO});
  }

  static PullStatus pull_number(VideoSource& source, uint64_t number) {
    frames::AcquiredFrame acquired;
    const PullStatus status = pull(source, acquired);
    if (status != PullStatus::Ready) return status;
    EXPECT_EQ(acquired.number, number);
    EXPECT_EQ(acquired.frame.bytes[0], number & 0xff);
    source.release(acquired.token);
    return status;
  }
};

TEST_F(FakeVideo, DeliversTenThousandLoops) {
  const auto source = open("3-well.mkv", true);
  for (int loop = 0; loop < 10000; ++loop) {
    for (uint64_t k = 0; k < 3; ++k)
      ASSERT_EQ(pull_number(*source, k), PullStatus::Ready) << source->failure() << loop;
    ASSERT_EQ(pull_number(*source, 0), PullStatus::End);
    ASSERT_TRUE(source->rewind());
  }
}

TEST_F(FakeVideo, RejectsAFrameThatWouldStayForMoreThanAnHour) {
  const auto source = open("5-leaps.mkv", false);
  ASSERT_EQ(pull_number(*source, 0), PullStatus::Ready);
  ASSERT_EQ(pull_number(*source, 1), PullStatus::Ready);
  EXPECT_EQ(pull_number(*source, 2), PullStatus::Failed);
  EXPECT_THAT(source->failure(), testing::HasSubstr("frame 1000002 instead of 2"));
}

/// Frame 1 is given while others are acquired, and again after it was released.
TEST_F(FakeVideo, AFrameThatStaysMayBeAcquiredMoreThanOnce) {
  const auto source = open("4-waits.mkv", true);
  const std::vector<int> pictures = {0, 1, 1, 1, 1, 2, 3};
  for (int loop = 0; loop < 100; ++loop) {
    std::optional<uint64_t> held;
    for (size_t k = 0; k < pictures.size(); ++k) {
      frames::AcquiredFrame acquired;
      ASSERT_EQ(pull(*source, acquired), PullStatus::Ready) << source->failure();
      EXPECT_EQ(acquired.number, k);
      EXPECT_EQ(acquired.frame.bytes[0], pictures[k]);
      EXPECT_EQ(acquired.repeats, k > 1 && k < 5);
      if (k % 2 == 0) {
        source->release(acquired.token);
      } else {
        if (held) source->release(*held);
        held = acquired.token;
      }
    }
    source->release(*held);
    expect_status(*source, PullStatus::End);
    ASSERT_TRUE(source->rewind());
  }
}

TEST_F(FakeVideo, AFileThatIsReadTooSlowlyIsRefused) {
  EXPECT_THAT(refusal({.file = file("slow.mkv"), .program = LENTICULE_FAKE_VIDEO}),
              testing::HasSubstr("crashed or took longer than 20 s"));
}

TEST_F(FakeVideo, ADecodersFailureAfterItsLastFrameIsIgnored) {
  const auto source = open("3-stumbles.mkv", false);
  for (int loop = 0; loop < 2; ++loop) {
    for (uint64_t k = 0; k < 3; ++k) ASSERT_EQ(pull_number(*source, k), PullStatus::Ready);
    ASSERT_EQ(pull_number(*source, 0), PullStatus::End);
    ASSERT_TRUE(source->rewind());
  }
}

TEST_F(FakeVideo, InvalidMessagesAreRejected) {
  const auto source = open("3-noise.mkv", false);
  for (uint64_t k = 0; k < 3; ++k) ASSERT_EQ(pull_number(*source, k), PullStatus::Ready);
  EXPECT_EQ(pull_number(*source, 0), PullStatus::End);
}

TEST_F(FakeVideo, ADecoderThatRefusesIsNotRestarted) {
  const auto source = open("3-refuses.mkv", false);
  EXPECT_EQ(pull_number(*source, 0), PullStatus::Failed);
  EXPECT_THAT(source->failure(), testing::HasSubstr("it is no clip"));
  EXPECT_EQ(source->statistics().restarts, 0u);
}

}  // namespace
}  // namespace lenticule::player
