// SPDX-License-Identifier: Apache-2.0
// Tests live pictures with fake cameras: which picture is taken, how those of several cameras are
// paired, and what is said when none comes.
#include "player/sources/capture_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "player/sources/content.h"
#include "tests/support/comes_true.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;
using frames::capture::FrameSize;
using frames::capture::GrabStatus;
using frames::capture::Nanoseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::FakeFrame;
using testing::HasSubstr;

constexpr frames::FrameGeometry kPanel{.width = 8, .height = 4};
constexpr Nanoseconds kStart = seconds(100);

/// Two cameras of grey pictures, which come when a test adds them.
class Cameras : public testing::Test {
 protected:
  Cameras() {
    for (test::FakeCamera* camera : {&left_, &right_}) {
      camera->endless = false;
      camera->adjust = [](v4l2_pix_format& pix) {
        pix.bytesperline = pix.width;
        pix.sizeimage = pix.width * pix.height;
      };
    }
    system_.entries = {{{"/dev/video0", ""}, &left_}, {{"/dev/video2", ""}, &right_}};
  }
  LiveCameras opened(const std::string& text = "v4l2:/dev/video0") {
    return {parse_capture(text), kPanel, system_, statistics_};
  }
  Error refusal(const std::string& text = "v4l2:/dev/video0") {
    return test::error_of([&] { (void)opened(text); });
  }
  static FakeFrame taken(Nanoseconds after, uint8_t code) {
    return {.code = code, .time = kStart + after};
  }
  GrabStatus next(LiveCameras& cameras, Nanoseconds timeout = milliseconds(10)) {
    frame_ = frames::WovenFrame(cameras.geometry());
    return cameras.next(frame_, captured_, timeout);
  }
  /// Returns the code of the picture of a camera.
  [[nodiscard]] int code_of(int camera) const { return frame_.row(1)[camera * 8 * 3 + 4]; }

  test::FakeCamera left_, right_;
  test::FakeSystem system_;
  CaptureStatistics statistics_;
  frames::WovenFrame frame_;
  Nanoseconds captured_{0};
};

TEST_F(Cameras, TheNewestPictureReplacesOlderOnes) {
  LiveCameras cameras = opened();
  left_.frames = {taken(milliseconds(-90), 10), taken(milliseconds(-60), 20),
                  taken(milliseconds(-30), 30)};
  ASSERT_EQ(next(cameras), GrabStatus::Ready);
  EXPECT_EQ(code_of(0), 30);
  EXPECT_EQ(captured_, kStart - milliseconds(30));
  EXPECT_EQ(statistics_.superseded.get(), 2u);
  EXPECT_EQ(statistics_.pictures.get(), 1u);
  EXPECT_EQ(statistics_.arrival.summary().count, 3u);
  EXPECT_EQ(next(cameras), GrabStatus::TimedOut);
}

TEST_F(Cameras, CountsGapsInTheNumbersButNoNonsense) {
  LiveCameras cameras = opened();
  // Two lost; a restart; a number that cannot be; a wrap at 32 bits.
  for (const uint32_t number : {5u, 8u, 0u, 4'000'000'000u, 4'294'967'295u, 0u}) {
    FakeFrame frame = taken(left_.clock - kStart, 50);
    frame.sequence = number;
    left_.frames = {frame};
    ASSERT_EQ(next(cameras), GrabStatus::Ready) << number;
  }
  EXPECT_EQ(statistics_.lost.get(), 2u);
}

TEST_F(Cameras, DamagedPicturesAreSkippedAndCounted) {
  LiveCameras cameras = opened();
  FakeFrame bad = taken(milliseconds(-5), 1);
  bad.flags |= V4L2_BUF_FLAG_ERROR;
  FakeFrame part = taken(milliseconds(-3), 2);
  part.bytesused = 7;
  left_.frames = {bad, taken(milliseconds(-4), 77)};
  ASSERT_EQ(next(cameras), GrabStatus::Ready);
  EXPECT_EQ(code_of(0), 77);
  left_.frames = {part};
  EXPECT_EQ(next(cameras), GrabStatus::Corrupt);
  EXPECT_EQ(statistics_.damaged.get(), 2u);
  left_.frames = {taken(left_.clock - kStart, 78)};
  EXPECT_EQ(next(cameras), GrabStatus::Ready) << "its buffers were given back";
}

TEST_F(Cameras, PairsThePicturesOfOneMomentSideBySide) {
  // The second camera is 10 ms late, then 25 of 33 ms: then its picture belongs to the next one.
  for (const milliseconds late : {milliseconds(10), milliseconds(25)}) {
    left_.clock = right_.clock = kStart;
    CaptureStatistics statistics;
    LiveCameras cameras(parse_capture("v4l2:/dev/video0,/dev/video2"), kPanel, system_, statistics);
    EXPECT_EQ(cameras.geometry(), (frames::FrameGeometry{.width = 16, .height = 4}));
    uint64_t pairs = 0;
    for (int k = 0; k < 20; ++k) {
      const Nanoseconds at = milliseconds(33 * k);
      left_.clock = right_.clock = kStart + at + late;
      left_.frames.push_back(taken(at, static_cast<uint8_t>(100 + k)));
      right_.frames.push_back(taken(at + late, static_cast<uint8_t>(200 + k)));
      frame_ = frames::WovenFrame(cameras.geometry());
      bool found = false;
      for (int tries = 0; tries < 3 && !found; ++tries)
        found = cameras.next(frame_, captured_, Nanoseconds{0}) == GrabStatus::Ready;
      if (!found) continue;
      ++pairs;
      const bool same = late < milliseconds(16);
      EXPECT_EQ(code_of(1) - 200, code_of(0) - 100 - (same ? 0 : 1)) << k;
    }
    EXPECT_GE(pairs, 18u);
    EXPECT_EQ(statistics.pictures.get(), pairs);
    const double apart = late < milliseconds(16) ? 10'000 : 8'000;
    EXPECT_NEAR(statistics.apart.summary().max_us, apart, 1.0);
  }
}

TEST_F(Cameras, ADriverOfTwoBuffersAlwaysHasOneToFill) {
  left_.most_buffers = right_.most_buffers = 2;
  LiveCameras cameras = opened("v4l2:/dev/video0,/dev/video2");
  left_.frames = {taken(Nanoseconds{0}, 1), taken(milliseconds(33), 2), taken(milliseconds(66), 3)};
  right_.frames = {taken(milliseconds(66), 4)};
  left_.clock = right_.clock = kStart + milliseconds(66);
  ASSERT_EQ(next(cameras), GrabStatus::Ready);
  EXPECT_EQ(code_of(0), 3);
  EXPECT_EQ(code_of(1), 4);
}

TEST_F(Cameras, ACameraThatFallsSilentIsNamedWithTheReason) {
  LiveCameras cameras = opened("v4l2:/dev/video0,/dev/video2");
  left_.frames = {taken(Nanoseconds{0}, 1)};
  right_.frames = {taken(Nanoseconds{0}, 2)};
  ASSERT_EQ(next(cameras), GrabStatus::Ready);
  GrabStatus status = GrabStatus::TimedOut;
  for (int k = 0; k < 200 && status == GrabStatus::TimedOut; ++k) {
    left_.frames = {taken(left_.clock - kStart, 1)};
    status = next(cameras, milliseconds(50));
  }
  EXPECT_EQ(status, GrabStatus::Gone);
  EXPECT_EQ(cameras.failure(), "/dev/video2: no picture for 3 s");
}

TEST_F(Cameras, ALostSignalIsNamed) {
  LiveCameras cameras = opened();
  left_.input_status = V4L2_IN_ST_NO_SIGNAL;
  GrabStatus status = GrabStatus::TimedOut;
  for (int k = 0; k < 200 && status == GrabStatus::TimedOut; ++k)
    status = next(cameras, milliseconds(100));
  EXPECT_EQ(status, GrabStatus::Gone);
  EXPECT_EQ(cameras.failure(), "/dev/video0: no signal");
  EXPECT_STREQ(refusal().what(), "/dev/video0: no usable signal: no signal");
  left_.input_status = V4L2_IN_ST_NO_ACCESS;
  EXPECT_THAT(refusal().what(), HasSubstr("encrypted"));
}

TEST_F(Cameras, AChangeOfTheSignalEndsTheStream) {
  LiveCameras cameras = opened();
  left_.events = {V4L2_EVENT_EOS};
  left_.frames = {taken(Nanoseconds{0}, 1)};
  EXPECT_EQ(next(cameras), GrabStatus::Ready) << "an event of another kind";
  left_.events = {V4L2_EVENT_SOURCE_CHANGE};
  EXPECT_EQ(next(cameras), GrabStatus::Gone);
  EXPECT_EQ(cameras.failure(), "/dev/video0: the signal changed");
}

TEST_F(Cameras, AnUnpluggedCameraIsReleased) {
  {
    LiveCameras cameras = opened();
    left_.unplugged = true;
    EXPECT_EQ(next(cameras), GrabStatus::Gone);
    EXPECT_EQ(cameras.failure(), "/dev/video0: unplugged");
  }
  EXPECT_TRUE(left_.released());
}

TEST_F(Cameras, ChoosesTheFormatThatTheDisplayCanUse) {
  const FrameSize vga{640, 480}, hd{1280, 720}, full{1920, 1080};
  left_.adjust = [](v4l2_pix_format&) {};
  left_.formats = {{V4L2_PIX_FMT_GREY, {full}},
                   {V4L2_PIX_FMT_YUYV, {vga, hd, full}},
                   {V4L2_PIX_FMT_MJPEG, {vga, hd, full}}};
  const auto chosen = [&](const std::string& text) {
    CaptureStatistics statistics;
    LiveCameras cameras(parse_capture(text), {.width = 1920, .height = 1080}, system_, statistics);
    return statistics.device;
  };
  EXPECT_THAT(chosen("v4l2:/dev/video0"), HasSubstr("1920x1080 YUYV")) << "rates are not listed";
  left_.fastest = [](uint32_t fourcc, uint32_t width) {
    return fourcc == V4L2_PIX_FMT_MJPEG ? 30.0 : width > 1000 ? 5.0 : 30.0;
  };
  EXPECT_THAT(chosen("v4l2:/dev/video0"), HasSubstr("1920x1080 MJPG")) << "as over USB 2";
  EXPECT_THAT(chosen("v4l2:/dev/video0?size=1280x720&rate=5"), HasSubstr("1280x720 YUYV"));
  EXPECT_THAT(chosen("v4l2:/dev/video0?format=GREY"), HasSubstr("1920x1080 GREY"));
  test::expect_error(refusal("v4l2:/dev/video0?format=NV12"), ErrorKind::Device, "no NV12 among",
                     "use one of those");
  left_.formats = {{V4L2_PIX_FMT_YUYV, {vga}}};
  test::expect_error(refusal("v4l2:/dev/video0?size=800x600"), ErrorKind::Device,
                     "has no pictures of 800x600; the nearest are 640x480", "--preflight");
}

TEST_F(Cameras, AnHdmiInputFollowsItsSignal) {
  left_.signal_error = 0;
  left_.adjust = [](v4l2_pix_format&) {};
  left_.timings = {.width = 1280, .height = 720, .pixelclock = 74'250'000};
  left_.timings.hfrontporch = 370;
  left_.timings.vfrontporch = 30;
  left_.reports_rate = false;
  left_.formats = {{V4L2_PIX_FMT_RGB24, {{1280, 720}, {1920, 1080}}}};
  const LiveCameras cameras = opened();
  EXPECT_EQ(cameras.geometry(), (frames::FrameGeometry{.width = 1280, .height = 720}));
  EXPECT_EQ(cameras.rate(), (frames::Rate{60000, 1000}));
  EXPECT_EQ(left_.logged("S_DV_TIMINGS"), 1);
}

TEST_F(Cameras, CamerasOfDifferentSizesAreRefused) {
  right_.formats = {{V4L2_PIX_FMT_GREY, {{4, 4}}}};
  test::expect_error(refusal("v4l2:/dev/video0,/dev/video2"), ErrorKind::Device,
                     "/dev/video2: pictures of 4x4, but /dev/video0 has 8x4", "?size=");
  EXPECT_TRUE(left_.released());
}

TEST_F(Cameras, MissingAndTakenCamerasAreNamed) {
  test::expect_error(refusal("v4l2:/dev/video9"), ErrorKind::Device,
                     "/dev/video9: cannot open it: no such file", "connect the camera");
  system_.holder = "zoom (77)";
  left_.errors[VIDIOC_REQBUFS] = {EBUSY};
  test::expect_error(refusal(), ErrorKind::Device, "in use by another program", "zoom (77)");
  left_.device_caps = V4L2_CAP_META_CAPTURE;
  test::expect_error(refusal(), ErrorKind::Device, "not a camera", "the other one");
}

TEST(CaptureName, IsReadOrRefused) {
  const CaptureSpec spec =
      parse_capture("v4l2:/dev/video0,/dev/v4l/by-id/usb-A?size=1280x720&format=MJPG&rate=29.97");
  EXPECT_THAT(spec.devices, testing::ElementsAre("/dev/video0", "/dev/v4l/by-id/usb-A"));
  EXPECT_EQ(spec.request.width, 1280);
  EXPECT_EQ(spec.request.height, 720);
  EXPECT_EQ(spec.request.pixel_format, "MJPG");
  EXPECT_EQ(spec.request.frames_per_second, 29.97);
  for (const char* text :
       {"v4l2:", "v4l2:?size=1x1", "v4l2:/dev/video0,,/dev/video1", "v4l2:/a?size=0x4",
        "v4l2:/a?size=99999x4", "v4l2:/a?size=", "v4l2:/a?format=ABCD", "v4l2:/a?rate=nan",
        "v4l2:/a?rate=0", "v4l2:/a?speed=1", "v4l2:1,2,3,4,5,6,7,8,9,0,1,2,3,4,5,6,7"})
    EXPECT_EQ(test::error_of([&] { (void)parse_capture(text); }).kind(), ErrorKind::Usage) << text;
}

TEST(CaptureName, FlagsStateTheLayout) {
  const auto kind = [](const std::string& text, const ContentFlags& flags) {
    return identify(parse_source(text, flags), {}).kind;
  };
  using Kind = Content::Kind;
  EXPECT_EQ(kind("v4l2:/dev/video0", {}), Kind::Woven);
  EXPECT_EQ(kind("v4l2:/dev/video0", {.stereo = "hsbs"}), Kind::Stereo);
  EXPECT_EQ(kind("v4l2:/dev/video0", {.depth = "right"}), Kind::DepthInside);
  EXPECT_EQ(kind("v4l2:/dev/video0", {.grid = "8x6"}), Kind::Quilt);
  const Content pair = identify(parse_source("v4l2:/dev/video0,/dev/video2"), {});
  EXPECT_EQ(pair.kind, Kind::Quilt);
  EXPECT_EQ(pair.layout.view_count(), 2);
  for (const ContentFlags& flags : {ContentFlags{.stereo = "sbs"}, ContentFlags{.depth = "a.png"}})
    EXPECT_THROW((void)kind("v4l2:/dev/video0,/dev/video2", flags), Error);
}

TEST_F(Cameras, TwoItemsShareACameraAndALostOneFails) {
  left_.endless = true;
  const std::string name = "v4l2:/dev/video0";
  OpenedCapture first = open_capture(name, kPanel, system_);
  OpenedCapture second = open_capture(name, kPanel, system_);
  EXPECT_EQ(first.statistics, second.statistics);
  frames::AcquiredFrame acquired;
  for (frames::FrameSource* source : {first.pictures.get(), second.pictures.get()}) {
    ASSERT_TRUE(test::comes_true([&] { return source->pull(acquired) == PullStatus::Ready; }));
    EXPECT_GT(acquired.captured_ns, 0);
    EXPECT_EQ(acquired.frame.row(0)[0], 128);
    source->release(acquired.token);
  }
  first.pictures.reset();
  ASSERT_TRUE(test::comes_true([&] {
    return second.pictures->pull(acquired) == PullStatus::Ready;
  })) << "the other item goes on";
  second.pictures.reset();
  EXPECT_TRUE(left_.released());

  left_.calls_until_unplugged = 100;
  OpenedCapture lost = open_capture(name, kPanel, system_);
  ASSERT_TRUE(
      test::comes_true([&] { return lost.pictures->pull(acquired) == PullStatus::Failed; }));
  EXPECT_THAT(lost.pictures->failure(), HasSubstr("/dev/video0: unplugged"));
}

}  // namespace
}  // namespace lenticule::player
