// SPDX-License-Identifier: Apache-2.0
// Tests which controls are locked, in which order, and which problems are reported.
#include "calib/cameras/camera_controls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::calib {
namespace {

using std::chrono::microseconds;
using test::FakeCamera;
using test::FakeControl;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr uint32_t kInactive = V4L2_CTRL_FLAG_INACTIVE | V4L2_CTRL_FLAG_VOLATILE;

/// Returns the controls of a good webcam: all can be set once they are not automatic.
std::vector<FakeControl> webcam_controls() {
  return {
      {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1},
      {V4L2_CID_GAIN, "Gain", 0, 255, 40},
      {V4L2_CID_WHITE_BALANCE_TEMPERATURE, "White Balance Temperature", 2800, 6500, 4600,
       kInactive},
      {V4L2_CID_SHARPNESS, "Sharpness", 2, 9, 5},
      {V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", 0, 3, V4L2_EXPOSURE_APERTURE_PRIORITY, 0, 1,
       V4L2_CTRL_TYPE_MENU},
      {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 3, 2047, 250, kInactive},
      {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic Framerate", 0, 1, 1},
      {V4L2_CID_FOCUS_ABSOLUTE, "Focus, Absolute", 0, 250, 30, kInactive, 5},
      {V4L2_CID_FOCUS_AUTO, "Focus, Automatic Continuous", 0, 1, 1},
  };
}

void release_manual_ones(FakeCamera& camera, uint32_t id, int32_t value) {
  if (id == V4L2_CID_EXPOSURE_AUTO && value == V4L2_EXPOSURE_MANUAL)
    camera.control(V4L2_CID_EXPOSURE_ABSOLUTE).flags = 0;
  if (id == V4L2_CID_FOCUS_AUTO && value == 0) camera.control(V4L2_CID_FOCUS_ABSOLUTE).flags = 0;
  if (id == V4L2_CID_AUTO_WHITE_BALANCE && value == 0)
    camera.control(V4L2_CID_WHITE_BALANCE_TEMPERATURE).flags = 0;
}

class Locking : public testing::Test {
 protected:
  Locking() {
    stage_.camera.controls = webcam_controls();
    stage_.camera.on_set = release_manual_ones;
    device_ = stage_.system.open("/dev/video0").device;
  }
  CameraControls with(const ControlRequests& requests) { return {*device_, requests}; }
  [[nodiscard]] long place(const std::string& entry) const {
    const auto& log = stage_.camera.log;
    const auto found = std::find(log.begin(), log.end(), entry);
    EXPECT_NE(found, log.end()) << entry;
    return found - log.begin();
  }
  test::OneCamera stage_;
  FakeCamera& camera_ = stage_.camera;
  std::unique_ptr<V4l2Device> device_;
};

TEST_F(Locking, SwitchesAutomaticOffBeforeSettingValues) {
  CameraControls controls = with({.gain = 7, .white_balance_kelvin = 5000, .focus = 100});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.unlocked(), IsEmpty());
  EXPECT_LT(place("set Auto Exposure=1"), place("set Exposure Time, Absolute=333"));
  EXPECT_LT(place("set White Balance, Automatic=0"), place("set White Balance Temperature=5000"));
  EXPECT_LT(place("set Focus, Automatic Continuous=0"), place("set Focus, Absolute=100"));
  EXPECT_EQ(camera_.control(V4L2_CID_EXPOSURE_AUTO_PRIORITY).value, 0);
  EXPECT_EQ(camera_.control(V4L2_CID_SHARPNESS).value, 2);
  EXPECT_EQ(camera_.control(V4L2_CID_GAIN).value, 7);
  EXPECT_EQ(controls.exposure(), microseconds(33300));
}

TEST_F(Locking, LeavesUnrequestedValuesAlone) {
  CameraControls controls = with({});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_EQ(camera_.control(V4L2_CID_GAIN).value, 40);
  EXPECT_EQ(camera_.control(V4L2_CID_FOCUS_ABSOLUTE).value, 30);
  EXPECT_THAT(controls.unlocked(), IsEmpty());
}

TEST_F(Locking, ReportsControlsThatStayAutomatic) {
  camera_.on_set = nullptr;  // the other controls stay inactive
  CameraControls controls = with({.focus = 100});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.unlocked(),
              ElementsAre("Exposure Time, Absolute cannot be set: it is automatic",
                          "White Balance Temperature is automatic",
                          "Focus, Absolute cannot be set: it is automatic"));
  EXPECT_EQ(controls.exposure(), std::nullopt);
}

TEST_F(Locking, ReportsMissingControls) {
  camera_.controls.clear();
  CameraControls controls = with({});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.unlocked(), ElementsAre("no manual exposure", "no manual gain",
                                               "no manual white balance", "no manual focus"));
}

TEST_F(Locking, ReadsBackTheValuesThatTheCameraSet) {
  camera_.on_set = [](FakeCamera& camera, uint32_t id, int32_t value) {
    release_manual_ones(camera, id, value);
    if (id == V4L2_CID_GAIN) camera.control(id).value = 8;
    if (id == V4L2_CID_EXPOSURE_AUTO) camera.control(id).value = 3;
  };
  CameraControls controls = with({.gain = 7});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.unlocked(), ElementsAre("Auto Exposure: set to 1, but the camera has 3",
                                               "Gain: set to 7, but the camera has 8"));
  EXPECT_THAT(controls.drifted(), IsEmpty()) << "8 is what is held";
}

TEST_F(Locking, ReportsExposuresThatAreNotWholeRefreshes) {
  camera_.on_set = [](FakeCamera& camera, uint32_t id, int32_t value) {
    release_manual_ones(camera, id, value);
    if (id == V4L2_CID_EXPOSURE_ABSOLUTE)
      camera.control(id).value = 312;  // rounds to steps, as many cameras do
  };
  CameraControls controls = with({});
  ASSERT_EQ(controls.lock(), 0);
  ASSERT_EQ(controls.unlocked().size(), 1U);
  EXPECT_THAT(controls.unlocked()[0], HasSubstr("31.2 ms are not whole refreshes of 16.67 ms"));
  EXPECT_EQ(controls.exposure(), microseconds(31200));
}

TEST_F(Locking, GrabbedAndReadOnlyControlsAreNamed) {
  camera_.control(V4L2_CID_GAIN).flags = V4L2_CTRL_FLAG_GRABBED;
  camera_.control(V4L2_CID_SHARPNESS).flags = V4L2_CTRL_FLAG_READ_ONLY;
  CameraControls controls = with({.gain = 3});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.unlocked(), ElementsAre("Sharpness cannot be set: permission denied",
                                               "Gain cannot be set: permission denied"));
}

TEST_F(Locking, AFailingControlDoesNotStopTheOthers) {
  camera_.errors[VIDIOC_S_EXT_CTRLS] = {EIO, 0, 0};
  CameraControls controls = with({.gain = 9});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.unlocked(), Contains("Auto Exposure cannot be set: input/output error"));
  EXPECT_EQ(camera_.control(V4L2_CID_GAIN).value, 9);
}

TEST_F(Locking, DetectsDrift) {
  CameraControls controls = with({});
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.drifted(), IsEmpty());
  camera_.control(V4L2_CID_FOCUS_ABSOLUTE).value = 45;
  camera_.control(V4L2_CID_AUTO_WHITE_BALANCE).value = 1;
  EXPECT_THAT(controls.drifted(), ElementsAre("White Balance, Automatic was 0 and is now 1",
                                              "Focus, Absolute was 30 and is now 45"));
  ASSERT_EQ(controls.lock(), 0);
  EXPECT_THAT(controls.drifted(), IsEmpty());
}

TEST_F(Locking, AnUnpluggedCameraHasDrifted) {
  CameraControls controls = with({});
  ASSERT_EQ(controls.lock(), 0);
  camera_.unplugged = true;
  const std::vector<std::string> drifted = controls.drifted();
  ASSERT_EQ(drifted.size(), 1U);
  EXPECT_THAT(drifted[0], HasSubstr("no such device"));
}

TEST_F(Locking, LimitsAnEndlessListOfControls) {
  camera_.endless_controls = true;
  CameraControls controls = with({.gain = 5});
  EXPECT_EQ(controls.lock(), 0);
  EXPECT_EQ(camera_.control(V4L2_CID_GAIN).value, 5) << "the others are locked all the same";
}

TEST_F(Locking, ToleratesAbsurdRanges) {
  for (FakeControl& control : camera_.controls) {
    control.minimum = std::numeric_limits<int64_t>::min();
    control.maximum = std::numeric_limits<int64_t>::max();
    control.step = -1;
  }
  CameraControls controls = with({.gain = 7, .focus = -12});
  EXPECT_EQ(controls.lock(), 0);
  std::swap(camera_.control(V4L2_CID_EXPOSURE_ABSOLUTE).minimum,
            camera_.control(V4L2_CID_EXPOSURE_ABSOLUTE).maximum);
  EXPECT_EQ(controls.lock(), 0);
}

ControlInfo exposure_control(int64_t minimum, int64_t maximum, int64_t step = 1) {
  ControlInfo control;
  control.type = V4L2_CTRL_TYPE_INTEGER;
  control.minimum = minimum;
  control.maximum = maximum;
  control.step = step;
  return control;
}

TEST(WholeRefreshes, FitIntoTheControlsRange) {
  EXPECT_EQ(whole_refreshes(exposure_control(1, 10000), 60.0, 1), 167);
  EXPECT_EQ(whole_refreshes(exposure_control(1, 10000), 60.0, 2), 333);
  EXPECT_EQ(whole_refreshes(exposure_control(1, 10000), 50.0, 3), 600);
  EXPECT_EQ(whole_refreshes(exposure_control(1, 10000), 59.94, 2), 334);
  EXPECT_EQ(whole_refreshes(exposure_control(1, 400), 60.0, 5), 333) << "no room for more";
  EXPECT_EQ(whole_refreshes(exposure_control(200, 900), 60.0, 1), 333) << "it does not go so low";
  EXPECT_EQ(whole_refreshes(exposure_control(1, 100), 60.0, 1), 100) << "none fits";
  EXPECT_EQ(whole_refreshes(exposure_control(0, 1000, 10), 60.0, 1), 170) << "in steps of 1 ms";
}

}  // namespace
}  // namespace lenticule::calib
