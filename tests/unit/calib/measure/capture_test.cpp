// SPDX-License-Identifier: Apache-2.0
// Tests capturing on the simulated bench and with faulty cameras.
#include "calib/measure/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "calib/measure/viewpoint.h"
#include "lab/panel/trial.h"

namespace lenticule::calib {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// A display that accepts every frame and counts them.
class PlainSink final : public frames::FrameSink {
 public:
  explicit PlainSink(const optics::Panel& panel)
      : geometry_{.width = panel.width_px, .height = panel.height_px} {}
  [[nodiscard]] frames::FrameGeometry geometry() const override { return geometry_; }
  [[nodiscard]] frames::ShowResult show(const frames::FrameView&,
                                        std::chrono::nanoseconds) override {
    ++shown;
    return result;
  }
  int shown = 0;
  frames::ShowResult result = frames::ShowResult::Shown;

 private:
  frames::FrameGeometry geometry_;
};

/// A camera that returns scripted answers.
class ScriptedCamera final : public Camera {
 public:
  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }
  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds timeout, Nanoseconds) override {
    now_ += timeout < milliseconds(33) ? timeout : Nanoseconds(milliseconds(33));
    out = {.width = 4, .height = 2, .channels = 1, .light = std::vector<float>(8, 0.5F)};
    out.time = stuck ? Nanoseconds(0) : now_;
    return status;
  }
  [[nodiscard]] Nanoseconds now() const override { return now_; }
  [[nodiscard]] std::vector<std::string> drifted_controls() override { return {}; }
  [[nodiscard]] std::string failure() const override { return "unplugged"; }

  GrabStatus status = GrabStatus::Ready;
  bool stuck = false;

 private:
  CameraFacts facts_;
  Nanoseconds now_{0};
};

class CaptureTest : public testing::Test {
 protected:
  std::string failure_of(const CaptureProgress& progress = {}) {
    PatternCapture capture(sink_, camera_, panel_, {}, progress);
    const std::vector<Pattern> patterns(3, Pattern{.shape = Flat{}, .channels = {}});
    try {
      capture.capture(patterns, [&](const Pattern&, const CameraPicture&) { ++taken_; });
    } catch (const Error& error) {
      kind_ = error.kind();
      return error.what();
    }
    return "";
  }

  optics::Panel panel_ = lab::trial_panel(320, 180);
  PlainSink sink_{panel_};
  ScriptedCamera camera_;
  int taken_ = 0;
  ErrorKind kind_ = ErrorKind::Failed;
};

TEST_F(CaptureTest, ShowsAndCapturesEveryPattern) {
  EXPECT_EQ(failure_of(), "");
  EXPECT_EQ(sink_.shown, 3);
  EXPECT_EQ(taken_, 3);
}

TEST_F(CaptureTest, AnUnpluggedCameraEndsTheCaptureWithAReason) {
  camera_.status = GrabStatus::Gone;
  EXPECT_THAT(failure_of(), HasSubstr("camera: unplugged"));
  EXPECT_EQ(kind_, ErrorKind::Device);
}

TEST_F(CaptureTest, ASilentOrBrokenCameraEndsTheCapture) {
  camera_.status = GrabStatus::TimedOut;
  EXPECT_THAT(failure_of(), HasSubstr("no picture for"));
  camera_.status = GrabStatus::Corrupt;
  EXPECT_THAT(failure_of(), HasSubstr("damaged"));
}

TEST_F(CaptureTest, AStoppedClockEndsTheCapture) {
  camera_.stuck = true;
  EXPECT_THAT(failure_of(), HasSubstr("never sees pattern"));
}

TEST_F(CaptureTest, ALostDisplayEndsTheCapture) {
  sink_.result = frames::ShowResult::Lost;
  EXPECT_THAT(failure_of(), HasSubstr("display: disconnected"));
  EXPECT_EQ(kind_, ErrorKind::Device);
}

TEST_F(CaptureTest, AnotherSizeIsRefused) {
  PlainSink other(lab::trial_panel(640, 360));
  EXPECT_THROW(PatternCapture(other, camera_, panel_, {}, {}), Error);
}

TEST_F(CaptureTest, CanBeInterrupted) {
  EXPECT_THAT(failure_of([](const Pattern&) { return false; }), HasSubstr("interrupted"));
  EXPECT_EQ(sink_.shown, 0);
}

TEST(Knock, OfALiveCameraIsNamedAndNotTakenForALongExposure) {
  lab::Trial trial = lab::plain_trial(960, 540, 480, 270);
  trial.camera.samples = 2;
  trial.viewpoints.resize(1);
  trial.before_pattern = [](lab::SimulatedBench& bench, size_t, int pattern) {
    // 2 mm to the side and 0.15 degrees
    if (pattern == 10) bench.move_camera({12.0, 20.0, 700.0}, {3.8, 0.0, 0.0}, 0.0);
  };
  EXPECT_THAT(run_trial(trial).failure, HasSubstr("camera: it moved between pattern 10 and 11"));
}

/// The display shows nothing and records the requested patterns.
TEST(PhotoPatterns, AreThePatternsOfANonAdaptiveMeasurement) {
  lab::Trial trial = lab::plain_trial(960, 540, 480, 270);
  trial.camera.samples = 2;
  trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 1.004);
  trial.start.sheet.slant = trial.sheet.slant;
  lab::SimulatedBench bench(trial.panel, trial.sheet, trial.link, trial.camera, 1);
  const optics::OpticalModel start(trial.start);
  CaptureOptions options;
  options.average = 1;
  std::vector<Pattern> shown;
  const CaptureProgress progress = [&](const Pattern& pattern) {
    shown.push_back(pattern);
    return true;
  };
  (void)measure_viewpoint(bench.sink(), bench.camera(), start, options,
                          {.name = "photos", .link_and_spot = false, .adaptive = false}, progress);
  const std::vector<Pattern> wanted = photo_patterns(trial.start);
  ASSERT_EQ(shown.size(), wanted.size());
  frames::WovenFrame a, b;
  for (size_t n = 0; n < wanted.size(); ++n) {
    draw_pattern(shown[n], trial.panel, a);
    draw_pattern(wanted[n], trial.panel, b);
    ASSERT_EQ(a, b) << n;
  }
}

}  // namespace
}  // namespace lenticule::calib
