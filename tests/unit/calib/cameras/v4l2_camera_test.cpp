// SPDX-License-Identifier: Apache-2.0
// Tests a camera from opening to closing, without serious faults.
#include "calib/cameras/v4l2_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::calib {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class OpenCamera : public testing::Test {
 protected:
  OpenCamera() {
    options_.device = "/dev/video0";
    options_.skipped_pictures = 0;
    camera_.controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure", 1, 1000, 100},
                        {V4L2_CID_GAIN, "Gain", 0, 100, 10},
                        {V4L2_CID_WHITE_BALANCE_TEMPERATURE, "Temperature", 2000, 7000, 5000},
                        {V4L2_CID_FOCUS_ABSOLUTE, "Focus", 0, 100, 10}};
  }
  std::unique_ptr<Camera> opened() { return open_v4l2_camera(options_, stage_.system); }

  test::OneCamera stage_;
  test::FakeCamera& camera_ = stage_.camera;
  V4l2Options options_;
  CameraPicture picture_;
};

TEST_F(OpenCamera, ReportsItsProperties) {
  const std::unique_ptr<Camera> camera = opened();
  const CameraFacts& facts = camera->facts();
  EXPECT_EQ(facts.name, "Fake Camera");
  EXPECT_EQ(facts.identity, "usb-1.2");
  EXPECT_EQ(facts.width, 8);
  EXPECT_EQ(facts.height, 4);
  EXPECT_EQ(facts.channels, 1);
  EXPECT_EQ(facts.frames_per_second, 30.0);
  EXPECT_EQ(facts.pixel_format, "GREY");
  EXPECT_THAT(facts.unlocked, IsEmpty());
}

TEST_F(OpenCamera, UsesItsStableNameIfItHasOne) {
  stage_.system.entries[0].node.stable_path = "/dev/v4l/by-id/usb-Maker_Camera_1234-index0";
  EXPECT_EQ(opened()->facts().identity, "/dev/v4l/by-id/usb-Maker_Camera_1234-index0");
}

TEST_F(OpenCamera, ReturnsPicturesInOrder) {
  camera_.frames = {{.code = 0}, {.code = 51}, {.code = 255}};
  const std::unique_ptr<Camera> camera = opened();
  for (const float light : {0.0F, 0.2F, 1.0F}) {
    ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
    ASSERT_EQ(picture_.light.size(), 32U);
    EXPECT_FLOAT_EQ(picture_.light.front(), light);
    EXPECT_FLOAT_EQ(picture_.light.back(), light);
  }
}

TEST_F(OpenCamera, ReturnsEveryBufferToTheDriver) {
  const std::unique_ptr<Camera> camera = opened();
  for (int i = 0; i < 100; ++i) ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
  EXPECT_EQ(picture_.sequence, 99U);
}

TEST_F(OpenCamera, TimestampsAndCountsPictures) {
  const Nanoseconds start = camera_.clock;
  camera_.frames = {{.sequence = 0xFFFFFFFF, .time = start - milliseconds{50}},
                    {.sequence = 2, .time = start - milliseconds{10}}};
  const std::unique_ptr<Camera> camera = opened();
  ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
  const uint64_t first = picture_.sequence;
  const Nanoseconds time = picture_.time;
  ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
  EXPECT_EQ(picture_.sequence - first, 3U) << "two were lost";
  EXPECT_EQ(picture_.time - time, milliseconds{40});
  // The exposure takes two refreshes, the readout one frame.
  EXPECT_NEAR(static_cast<double>((start - time).count()), 50e6 + 0.5 * (33.3e6 + 33.333e6), 1e5);
  EXPECT_THAT(camera->facts().unlocked, IsEmpty());
}

TEST_F(OpenCamera, UsesItsOwnClockWithoutMonotonicTimestamps) {
  camera_.frames = {{.flags = 0, .time = seconds{5}}, {.flags = 0, .time = seconds{6}}};
  const std::unique_ptr<Camera> camera = opened();
  ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
  EXPECT_LT(picture_.time, camera->now());
  EXPECT_GT(picture_.time, camera->now() - milliseconds{100});
  ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
  EXPECT_THAT(camera->facts().unlocked, testing::ElementsAre(HasSubstr("no usable timestamps")));
}

TEST_F(OpenCamera, SkipsTheFirstPictures) {
  options_.skipped_pictures = 2;
  camera_.frames = {{.code = 10}, {.code = 20, .flags = V4L2_BUF_FLAG_ERROR}, {.code = 255}};
  const std::unique_ptr<Camera> camera = opened();
  ASSERT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
  EXPECT_FLOAT_EQ(picture_.light.front(), 1.0F);
  EXPECT_EQ(picture_.sequence, 2U);
}

TEST_F(OpenCamera, LocksControlsBeforeAndAfterTheStart) {
  options_.gain = 33;
  const std::unique_ptr<Camera> camera = opened();
  EXPECT_EQ(camera_.logged("set Gain=33"), 2);
  const auto start = std::find(camera_.log.begin(), camera_.log.end(), "STREAMON");
  EXPECT_EQ(std::count(camera_.log.begin(), start, "set Gain=33"), 1);
}

TEST_F(OpenCamera, LocksAgainIfStreamingResetsControls) {
  options_.exposure_periods = 3;
  camera_.on_set = [](test::FakeCamera& camera, uint32_t, int32_t) {
    if (!camera.streaming) camera.control(V4L2_CID_EXPOSURE_ABSOLUTE).value = 7;
  };
  const std::unique_ptr<Camera> camera = opened();
  EXPECT_EQ(camera_.control(V4L2_CID_EXPOSURE_ABSOLUTE).value, 500);
  EXPECT_THAT(camera->facts().unlocked, IsEmpty()) << "what was wrong before no longer counts";
}

TEST_F(OpenCamera, DetectsDrift) {
  const std::unique_ptr<Camera> camera = opened();
  EXPECT_THAT(camera->drifted_controls(), IsEmpty());
  camera_.control(V4L2_CID_GAIN).value = 99;
  EXPECT_THAT(camera->drifted_controls(), Contains("Gain was 10 and is now 99"));
}

TEST_F(OpenCamera, ReleasesEverythingInTheRightOrder) {
  opened().reset();
  EXPECT_TRUE(camera_.released());
  EXPECT_THAT(camera_.log, Not(Contains("free while mapped")));
  ASSERT_GE(camera_.log.size(), 9U);
  const std::vector<std::string> end(camera_.log.end() - 9, camera_.log.end());
  EXPECT_THAT(end, testing::ElementsAre("STREAMOFF", "unmap", "unmap", "unmap", "unmap", "unmap",
                                        "unmap", "free", "close"));
}

TEST_F(OpenCamera, AcceptsFewerBuffersThanRequested) {
  camera_.most_buffers = 2;
  const std::unique_ptr<Camera> camera = opened();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Ready);
}

TEST_F(OpenCamera, RefusesOptionsOutOfRange) {
  const auto refused = [&](auto change) {
    V4l2Options options = options_;
    change(options);
    test::expect_error(test::error_of([&] { (void)open_v4l2_camera(options, stage_.system); }),
                       ErrorKind::Usage);
  };
  refused([](V4l2Options& options) { options.refresh_hz = 0.0; });
  refused([](V4l2Options& options) { options.refresh_hz = NAN; });
  refused([](V4l2Options& options) { options.exposure_periods = 0; });
  refused([](V4l2Options& options) { options.frames_per_second = -1.0; });
  refused([](V4l2Options& options) { options.width = -5; });
  refused([](V4l2Options& options) { options.skipped_pictures = -1; });
  refused([](V4l2Options& options) { options.pixel_format = "H264"; });
  EXPECT_EQ(camera_.open_count, 0);
}

TEST_F(OpenCamera, RefusesANodeForOtherData) {
  camera_.device_caps = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  const Error error = test::error_of([&] { (void)opened(); });
  EXPECT_EQ(error.kind(), ErrorKind::Device);
  EXPECT_STREQ(error.what(), "/dev/video0: not a camera");
  EXPECT_TRUE(camera_.released());
}

}  // namespace
}  // namespace lenticule::calib
