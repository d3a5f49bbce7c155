// SPDX-License-Identifier: Apache-2.0
// Tests cameras that are in use, forbidden, unplugged, or whose driver returns invalid data.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>

#include "calib/cameras/v4l2_camera.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::calib {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::FakeFrame;
using testing::HasSubstr;

V4l2Options options() {
  V4l2Options options;
  options.device = "/dev/video0";
  options.skipped_pictures = 0;
  return options;
}

class CameraFaults : public testing::Test {
 protected:
  std::unique_ptr<Camera> opened() { return open_v4l2_camera(options(), stage_.system); }
  Error refusal() {
    return test::error_of([&] { (void)opened(); });
  }
  GrabStatus grab(Camera& camera) { return camera.grab(picture_, seconds{1}); }

  test::OneCamera stage_;
  test::FakeCamera& camera_ = stage_.camera;
  CameraPicture picture_;
};

TEST_F(CameraFaults, AForbiddenCameraNamesTheGroup) {
  stage_.system.entries[0].open_error = EACCES;
  const Error error = refusal();
  EXPECT_EQ(error.kind(), ErrorKind::Device);
  EXPECT_STREQ(error.what(), "/dev/video0: cannot open it: permission denied");
  EXPECT_THAT(error.hint(), HasSubstr("usermod -aG video"));
  stage_.system.owning_group = "root";
  EXPECT_THAT(refusal().hint(), HasSubstr("only root"));
}

TEST_F(CameraFaults, ATakenCameraNamesTheProgram) {
  stage_.system.holder = "zoom (77)";
  for (const unsigned long request : {VIDIOC_S_FMT, VIDIOC_REQBUFS, VIDIOC_QBUF, VIDIOC_STREAMON}) {
    camera_.errors[request] = {EBUSY};
    test::expect_error(refusal(), ErrorKind::Device, "in use by another program", "zoom (77)");
    EXPECT_TRUE(camera_.released());
  }
  stage_.system.holder.clear();
  camera_.errors[VIDIOC_S_FMT] = {EBUSY};
  EXPECT_THAT(refusal().hint(), HasSubstr("fuser -v /dev/video0"));
}

TEST_F(CameraFaults, ReportsAMissingCamera) {
  stage_.system.entries.clear();
  const Error error = refusal();
  EXPECT_EQ(error.kind(), ErrorKind::Device);
  EXPECT_STREQ(error.what(), "/dev/video0: cannot open it: no such file or directory");
  EXPECT_THAT(error.hint(), HasSubstr("connect the camera"));
}

TEST_F(CameraFaults, ReportsAFullBus) {
  camera_.errors[VIDIOC_STREAMON] = {ENOSPC};
  EXPECT_THAT(refusal().what(), HasSubstr("not enough bandwidth on the USB bus"));
  EXPECT_TRUE(camera_.released());
}

TEST_F(CameraFaults, TooFewBuffersAreRefused) {
  for (const uint32_t most : {0U, 1U}) {
    camera_.most_buffers = most;
    EXPECT_THAT(refusal().what(), HasSubstr("cannot get buffers"));
    EXPECT_TRUE(camera_.released());
  }
}

TEST_F(CameraFaults, ReleasesBuffersThatCannotBeMapped) {
  camera_.map_fails = true;
  EXPECT_THAT(refusal().what(), HasSubstr("cannot get buffers: cannot allocate memory"));
  EXPECT_TRUE(camera_.released());
  camera_.map_fails = false;
  camera_.errors[VIDIOC_QUERYBUF] = {0, 0, EINVAL};
  EXPECT_THAT(refusal().what(), HasSubstr("cannot get buffers"));
  EXPECT_TRUE(camera_.released()) << "the two that were mapped as well";
}

TEST_F(CameraFaults, UnplugWhileOpeningIsAnErrorAtEveryCall) {
  int calls = 0;
  for (;; ++calls) {
    test::OneCamera stage;
    stage.camera.controls = {{V4L2_CID_GAIN, "Gain", 0, 100, 10}};
    stage.camera.calls_until_unplugged = calls;
    try {
      const std::unique_ptr<Camera> camera = open_v4l2_camera(options(), stage.system);
      if (!stage.camera.unplugged) break;
      // The camera is unplugged so late that only the next picture can fail.
      EXPECT_EQ(camera->grab(picture_, seconds{1}), GrabStatus::Gone) << "call " << calls;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Device) << "call " << calls;
    }
    EXPECT_TRUE(stage.camera.released()) << "call " << calls;
  }
  EXPECT_GT(calls, 30);
}

TEST_F(CameraFaults, UnplugWhileStreamingReleasesEverything) {
  const std::unique_ptr<Camera> camera = opened();
  ASSERT_EQ(grab(*camera), GrabStatus::Ready);
  camera_.unplugged = true;
  EXPECT_EQ(grab(*camera), GrabStatus::Gone);
  EXPECT_EQ(camera->failure(), "/dev/video0: unplugged");
  EXPECT_TRUE(camera_.released()) << "though the camera still lives";
  EXPECT_EQ(grab(*camera), GrabStatus::Gone);
  EXPECT_EQ(camera->drifted_controls(), std::vector<std::string>{"/dev/video0: unplugged"});
  (void)camera->now();
}

TEST_F(CameraFaults, UnplugBetweenAcquireAndReleaseIsDetected) {
  const std::unique_ptr<Camera> camera = opened();
  camera_.frames.emplace_back();
  camera_.calls_until_unplugged = 1;
  EXPECT_EQ(grab(*camera), GrabStatus::Gone);
  EXPECT_TRUE(camera_.released());
}

TEST_F(CameraFaults, AReconnectedCameraOpensAgain) {
  std::unique_ptr<Camera> camera = opened();
  camera_.unplugged = true;
  EXPECT_EQ(grab(*camera), GrabStatus::Gone);
  EXPECT_EQ(refusal().kind(), ErrorKind::Device);
  camera_.unplugged = false;
  camera = opened();
  EXPECT_EQ(grab(*camera), GrabStatus::Ready);
}

TEST_F(CameraFaults, DamagedPicturesAreDropped) {
  const uint32_t good = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  camera_.frames = {FakeFrame{.flags = good | V4L2_BUF_FLAG_ERROR},
                    FakeFrame{.bytesused = 8 * 3 * 3 + 7},  // the last row lacks one byte
                    FakeFrame{.bytesused = 0}, FakeFrame{.bytesused = 0xFFFFFFFF},
                    FakeFrame{.bytesused = 8 * 3 * 3 + 8}};
  const std::unique_ptr<Camera> camera = opened();
  for (int i = 0; i < 4; ++i) EXPECT_EQ(grab(*camera), GrabStatus::Corrupt) << i;
  EXPECT_EQ(grab(*camera), GrabStatus::Ready);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(grab(*camera), GrabStatus::Ready) << "no buffer is lost";
}

TEST_F(CameraFaults, DamagedJpegsAreDropped) {
  camera_.formats = {{V4L2_PIX_FMT_MJPEG, {{8, 8}}}};
  const std::unique_ptr<Camera> camera = opened();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(grab(*camera), GrabStatus::Corrupt);
}

TEST_F(CameraFaults, WaitsNoLongerThanItsTimeout) {
  camera_.endless = false;
  const std::unique_ptr<Camera> camera = opened();
  const Nanoseconds before = camera_.clock;
  EXPECT_EQ(camera->grab(picture_, milliseconds{250}), GrabStatus::TimedOut);
  EXPECT_EQ(camera_.clock - before, milliseconds{250});
  EXPECT_EQ(camera->grab(picture_, Nanoseconds{0}), GrabStatus::TimedOut);
  EXPECT_EQ(camera->grab(picture_, Nanoseconds{-5}), GrabStatus::TimedOut);
  EXPECT_EQ(camera_.clock - before, milliseconds{250});
  EXPECT_EQ(camera->grab(picture_, Nanoseconds::max()), GrabStatus::TimedOut);
  EXPECT_LE(camera_.polls, 8) << "it does not look again when time is up";
  camera_.frames.emplace_back();
  EXPECT_EQ(camera->grab(picture_, Nanoseconds{0}), GrabStatus::Ready) << "still usable";
}

TEST_F(CameraFaults, SignalsAndSpuriousWakeupsDoNotEndTheWait) {
  const std::unique_ptr<Camera> camera = opened();
  camera_.poll_answers = {0, 0, POLLIN, POLLIN, 0};
  camera_.errors[VIDIOC_DQBUF] = {EAGAIN, EINTR, EINTR, EAGAIN};
  EXPECT_EQ(grab(*camera), GrabStatus::Ready);
}

TEST_F(CameraFaults, ADriverThatIsReadyWithoutPicturesTimesOut) {
  const std::unique_ptr<Camera> camera = opened();
  camera_.poll_answers.assign(5000, POLLIN);
  camera_.errors[VIDIOC_DQBUF].assign(5000, EAGAIN);
  EXPECT_EQ(camera->grab(picture_, std::chrono::hours{1}), GrabStatus::TimedOut);
  EXPECT_EQ(grab(*camera), GrabStatus::TimedOut);
}

TEST_F(CameraFaults, CallsInterruptedForeverFail) {
  camera_.errors[VIDIOC_REQBUFS].assign(1000, EINTR);
  EXPECT_THAT(refusal().what(), HasSubstr("interrupted system call"));
}

TEST_F(CameraFaults, ATransientErrorLosesAPictureAPersistentOneTheCamera) {
  const std::unique_ptr<Camera> camera = opened();
  camera_.poll_answers.assign(1000, POLLIN);
  camera_.errors[VIDIOC_DQBUF].assign(3, EIO);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(grab(*camera), GrabStatus::Corrupt);
  camera_.frames.emplace_back();
  EXPECT_EQ(grab(*camera), GrabStatus::Ready);
  camera_.errors[VIDIOC_DQBUF].assign(1000, EIO);
  GrabStatus status = GrabStatus::Corrupt;
  int grabs = 0;
  for (; grabs < 1000 && status == GrabStatus::Corrupt; ++grabs) status = grab(*camera);
  EXPECT_EQ(status, GrabStatus::Gone);
  EXPECT_LT(grabs, 100);
  EXPECT_EQ(camera->failure(), "/dev/video0: the stream broke: input/output error");
  EXPECT_TRUE(camera_.released());
}

TEST_F(CameraFaults, ABrokenStreamLosesTheCamera) {
  for (const int events : {POLLERR, POLLHUP, POLLNVAL, -EBADF}) {
    const std::unique_ptr<Camera> camera = opened();
    camera_.poll_answers = {events};
    camera_.errors[VIDIOC_DQBUF] = {EAGAIN};
    EXPECT_EQ(grab(*camera), GrabStatus::Gone) << events;
    EXPECT_THAT(camera->failure(), HasSubstr("the stream broke"));
    EXPECT_TRUE(camera_.released());
    camera_.errors.clear();
  }
}

TEST_F(CameraFaults, IgnoresAnInvalidBufferIndex) {
  camera_.frames = {FakeFrame{.index = 4000}};
  const std::unique_ptr<Camera> camera = opened();
  EXPECT_EQ(grab(*camera), GrabStatus::Gone);
  EXPECT_TRUE(camera_.released());
}

TEST_F(CameraFaults, ABufferThatCannotBeRequeuedLosesTheCamera) {
  const std::unique_ptr<Camera> camera = opened();
  camera_.errors[VIDIOC_QBUF] = {EINVAL};
  EXPECT_EQ(grab(*camera), GrabStatus::Gone);
  EXPECT_THAT(camera->failure(), HasSubstr("invalid argument"));
}

}  // namespace
}  // namespace lenticule::calib
