// SPDX-License-Identifier: Apache-2.0
// Tests the properties of the simulated camera: noise, mosaic, codes, JPEG, time, and unplugging.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "bench_stage.h"
#include "lab/panel/driven_panel.h"
#include "lab/panel/simulated_bench.h"
#include "lab/panel/trial.h"

namespace lenticule::lab {
namespace {

struct Statistics {
  double mean = 0.0;
  double deviation = 0.0;
};

/// Returns the statistics of one channel over a part of the picture; the edges are shares of the
/// sides.
Statistics statistics(const calib::CameraPicture& picture, int channel, double left, double top,
                      double right, double bottom) {
  double sum = 0.0;
  double squares = 0.0;
  int count = 0;
  for (int row = static_cast<int>(top * picture.height); row < bottom * picture.height; ++row) {
    for (int column = static_cast<int>(left * picture.width); column < right * picture.width;
         ++column, ++count) {
      const double light = double{light_at(picture, column, row, channel)};
      sum += light;
      squares += light * light;
    }
  }
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean))};
}

Statistics middle(const calib::CameraPicture& picture, int channel) {
  return statistics(picture, channel, 0.4, 0.4, 0.6, 0.6);
}

double row_light(const calib::CameraPicture& picture, int row) {
  double sum = 0.0;
  for (int column = 60; column < 100; ++column) {
    sum += double{light_at(picture, column, row, 0)};
  }
  return sum;
}

/// A bench of few pixels for tests that do not depend on lenses.
struct Stage {
  optics::Panel panel = small_panel(320, 180);
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  SimulatedPanelLink link;
  SimulatedCamera camera = quiet_camera(160, 120);

  [[nodiscard]] SimulatedBench bench(uint64_t seed = 1) const {
    return SimulatedBench(panel, sheet, link, camera, seed);
  }
  [[nodiscard]] frames::WovenFrame grey(uint8_t code) const {
    return plain_frame(panel, code, code, code);
  }
  [[nodiscard]] calib::CameraPicture see(const frames::WovenFrame& frame, uint64_t seed = 1) const {
    SimulatedBench made(panel, sheet, link, camera, seed);
    return look(made, frame);
  }
};

TEST(SimulatedCamera, RendersWhiteWithItsBrightness) {
  Stage stage;
  stage.camera.samples = 40;
  EXPECT_NEAR(middle(stage.see(stage.grey(255)), 0).mean, 0.7, 0.007);
  EXPECT_EQ(middle(stage.see(stage.grey(0)), 0).mean, 0.0);
  const double expected = 0.7 * frames::linear_from_srgb(100 / 255.0);
  EXPECT_NEAR(middle(stage.see(stage.grey(100)), 0).mean, expected, 0.01 * expected);
  stage.link.eotf_exponent = 2.0;
  const double squared = 0.7 * (100 / 255.0) * (100 / 255.0);
  EXPECT_NEAR(middle(stage.see(stage.grey(100)), 0).mean, squared, 0.01 * squared);
}

TEST(SimulatedCamera, HasReadAndShotNoise) {
  Stage stage;
  stage.camera = quiet_camera(320, 240);
  stage.camera.ambient = 0.25;
  stage.camera.read_noise = 0.01;
  stage.camera.shot_noise = 0.04;
  const calib::CameraPicture dark = stage.see(stage.grey(0));
  const Statistics seen = statistics(dark, 0, 0.0, 0.0, 1.0, 1.0);
  EXPECT_NEAR(seen.mean, 0.25, 0.001);
  const double expected = std::sqrt(0.01 * 0.01 + 0.04 * 0.04 * 0.25);
  EXPECT_NEAR(seen.deviation, expected, 0.02 * expected);
}

TEST(SimulatedCamera, DrawsNewNoiseForEveryPicture) {
  Stage stage;
  stage.camera.ambient = 0.25;
  stage.camera.read_noise = 0.02;
  SimulatedBench bench = stage.bench();
  const calib::CameraPicture first = look(bench, stage.grey(0));
  calib::CameraPicture second;
  ASSERT_EQ(bench.camera().grab(second, kLong), calib::GrabStatus::Ready);
  double product = 0.0;
  for (size_t i = 0; i < first.light.size(); ++i) {
    product += (double{first.light[i]} - 0.25) * (double{second.light[i]} - 0.25);
  }
  const double covariance = product / static_cast<double>(first.light.size());
  EXPECT_LT(std::abs(covariance), 0.05 * 0.02 * 0.02);
}

TEST(SimulatedCamera, SeparatesColoursThroughItsMosaic) {
  Stage stage;
  stage.camera.bayer = true;
  stage.camera.samples = 40;
  const calib::CameraPicture red = stage.see(plain_frame(stage.panel, 255, 0, 0));
  ASSERT_EQ(red.channels, 3);
  EXPECT_NEAR(middle(red, 0).mean, 0.7, 0.02);
  EXPECT_EQ(middle(red, 1).mean, 0.0);
  EXPECT_EQ(middle(red, 2).mean, 0.0);
  const calib::CameraPicture blue = stage.see(plain_frame(stage.panel, 0, 0, 255));
  EXPECT_EQ(middle(blue, 0).mean, 0.0);
  EXPECT_NEAR(middle(blue, 2).mean, 0.7, 0.02);
}

TEST(SimulatedCamera, MixesColoursByItsResponse) {
  Stage stage;
  stage.camera.bayer = true;
  stage.camera.samples = 40;
  stage.camera.response = {{{1, 0, 0}, {0.25, 1, 0}, {0, 0, 1}}};
  const calib::CameraPicture red = stage.see(plain_frame(stage.panel, 255, 0, 0));
  EXPECT_NEAR(middle(red, 1).mean, 0.7 * 0.25 / 1.25, 0.01);
  EXPECT_NEAR(middle(stage.see(stage.grey(255)), 1).mean, 0.7, 0.02);
}

TEST(SimulatedCamera, RoundsToEightBitsOfItsTransferFunction) {
  Stage stage;
  stage.camera.curve = stage.camera.assumed_curve = CameraCurve::Srgb;
  stage.camera.eight_bits = true;
  const calib::CameraPicture picture = stage.see(fringe_frame(stage.panel, 7.9, 0.25, 0.0));
  std::set<float> values(picture.light.begin(), picture.light.end());
  EXPECT_GT(values.size(), 10U);
  for (const float value : values) {
    const double code = frames::srgb_from_linear(double{value}) * 255.0;
    EXPECT_NEAR(code, std::round(code), 1e-3);
  }
}

TEST(SimulatedCamera, IsReadWithTheAssumedTransferFunction) {
  Stage stage;
  stage.camera.ambient = 0.5;
  stage.camera.curve = CameraCurve::Gamma;
  stage.camera.gamma = 2.0;
  stage.camera.assumed_curve = CameraCurve::Linear;
  const calib::CameraPicture picture = stage.see(stage.grey(0));
  EXPECT_NEAR(double{light_at(picture, 3, 3, 0)}, std::sqrt(0.5), 1e-4);
}

/// Returns the root mean square difference of all values.
double difference(const calib::CameraPicture& a, const calib::CameraPicture& b) {
  double squares = 0.0;
  for (size_t i = 0; i < a.light.size(); ++i) {
    const double d = double{a.light[i]} - double{b.light[i]};
    squares += d * d;
  }
  return std::sqrt(squares / static_cast<double>(a.light.size()));
}

TEST(SimulatedCamera, LosesDetailToJpeg) {
  Stage stage;
  stage.camera.bayer = true;
  stage.camera.curve = stage.camera.assumed_curve = CameraCurve::Srgb;
  stage.camera.eight_bits = true;
  const frames::WovenFrame fringes = fringe_frame(stage.panel, 7.9, 0.25, 0.0);
  const calib::CameraPicture plain = stage.see(fringes);
  stage.camera.jpeg_quality = 95;
  const calib::CameraPicture fine = stage.see(fringes);
  stage.camera.jpeg_quality = 20;
  const calib::CameraPicture coarse = stage.see(fringes);
  EXPECT_GT(difference(plain, fine), 0.001);
  EXPECT_GT(difference(plain, coarse), 1.5 * difference(plain, fine));
  EXPECT_LT(difference(plain, coarse), 0.2);
  EXPECT_NEAR(middle(fine, 1).mean, middle(plain, 1).mean, 0.02);
}

TEST(SimulatedCamera, DarkensTowardTheCorners) {
  Stage stage;
  stage.camera = quiet_camera(320, 240);
  stage.camera.focal_px = 300.0;  // a wide angle, near the panel
  stage.camera.position_mm = {0, 0, 130};
  stage.camera.samples = 30;
  stage.camera.white_light = 0.3;  // nothing clips
  const calib::CameraPicture even = stage.see(stage.grey(255));
  stage.camera.vignetting = true;
  const calib::CameraPicture vignetted = stage.see(stage.grey(255));
  const double side = statistics(vignetted, 0, 0.05, 0.45, 0.10, 0.55).mean /
                      statistics(even, 0, 0.05, 0.45, 0.10, 0.55).mean;
  const double tangent = (0.5 - 0.075) * 320 / 300.0;
  EXPECT_NEAR(side, std::pow(1.0 + tangent * tangent, -2.0), 0.01);
}

TEST(SimulatedCamera, SaturatesInAReflection) {
  Stage stage;
  stage.camera.highlight_x = 0.5;
  stage.camera.highlight_y = 0.5;
  stage.camera.highlight_half_width = 0.1;
  stage.camera.highlight_half_height = 0.1;
  const calib::CameraPicture picture = stage.see(stage.grey(0));
  EXPECT_EQ(light_at(picture, 80, 60, 0), 1.0F);
  EXPECT_EQ(light_at(picture, 110, 60, 0), 0.0F);
  EXPECT_EQ(light_at(picture, 80, 90, 0), 0.0F);
}

TEST(SimulatedCamera, DriftsInGainAndHasBands) {
  Stage stage;
  stage.camera.ambient = 0.0;
  stage.camera.gain_drift = 0.05;
  SimulatedBench drifting = stage.bench();
  std::set<double> means;
  const calib::CameraPicture first = look(drifting, stage.grey(255));
  calib::CameraPicture picture;
  for (int i = 0; i < 4; ++i) {
    ASSERT_EQ(drifting.camera().grab(picture, kLong), calib::GrabStatus::Ready);
    means.insert(middle(picture, 0).mean / middle(first, 0).mean);
  }
  EXPECT_GT(*means.rbegin() - *means.begin(), 0.01);
  EXPECT_FALSE(drifting.camera().facts().unlocked.empty());

  stage.camera.gain_drift = 0.0;
  const calib::CameraPicture even = stage.see(stage.grey(255));
  stage.camera.row_banding = 0.1;
  const calib::CameraPicture banded = stage.see(stage.grey(255));
  double lowest = 2.0;
  double highest = 0.0;
  for (int row = 30; row < 90; ++row) {
    const double gain = row_light(banded, row) / row_light(even, row);
    lowest = std::min(lowest, gain);
    highest = std::max(highest, gain);
  }
  EXPECT_LT(highest, 1.1001);
  EXPECT_GT(lowest, 0.8999);
  EXPECT_GT(highest - lowest, 0.1);
}

TEST(LightTiming, MixesFramesAsAnIntegralOverTheExposure) {
  for (const double begin : {-30.0, -9.0, -3.0, 0.0, 4.0, 40.0}) {
    const double length = 16.0;
    const double response = 7.0;
    double sum = 0.0;
    constexpr int kSlices = 100000;
    for (int n = 0; n < kSlices; ++n) {
      const double t = begin + length * (n + 0.5) / kSlices;
      sum += t < 0.0 ? 1.0 : std::exp(-t / response);
    }
    EXPECT_NEAR(old_frame_part(begin + 5.0, length, 5.0, response), sum / kSlices, 1e-4) << begin;
  }
  EXPECT_DOUBLE_EQ(old_frame_part(-4.0, 16.0, 0.0, 0.0), 0.25);
}

TEST(LightTiming, WholePeriodsOfTheBacklightCancel) {
  EXPECT_NEAR(backlight_mean(1.234, 1000.0 / 240.0 * 4.0, 240.0, 0.3), 1.0, 1e-9);
  EXPECT_NEAR(backlight_mean(0.0, 1.0, 250.0, 0.5), 2.0, 1e-9);  // backlight on all the time
  EXPECT_NEAR(backlight_mean(2.5, 1.0, 250.0, 0.5), 0.0, 1e-9);
  EXPECT_EQ(backlight_mean(3.0, 1.0, 0.0, 0.5), 1.0);
}

TEST(SimulatedCamera, ShowsANewFrameArriveRowByRow) {
  Stage stage;
  stage.link.response_ms = 6.0;
  stage.camera.rolling_shutter_ms = 25.0;
  stage.camera.exposure_ms = 5.0;
  SimulatedBench bench = stage.bench();
  const calib::CameraPicture white = look(bench, stage.grey(255));
  calib::CameraPicture black;
  ASSERT_EQ(bench.sink().show(stage.grey(0).view(), kLong), frames::ShowResult::Shown);
  const double switched = std::chrono::duration<double, std::milli>(bench.camera().now()).count();
  ASSERT_EQ(bench.camera().grab(black, kLong), calib::GrabStatus::Ready);
  const double centre = std::chrono::duration<double, std::milli>(black.time).count();
  double least = 1.0;
  double most = 0.0;
  for (int row = 30; row < 90; row += 10) {
    const double begin = centre - 15.0 + 25.0 * row / 120.0;
    const double expected = old_frame_part(begin, 5.0, switched, 6.0);
    const double seen = row_light(black, row) / row_light(white, row);
    EXPECT_NEAR(seen, expected, 1e-3) << row;
    least = std::min(least, expected);
    most = std::max(most, expected);
  }
  EXPECT_GT(most - least, 0.2);  // otherwise the test would prove little
}

TEST(SimulatedCamera, ShowsNoTraceOfAFrameAfterItsResponseTime) {
  Stage stage;
  stage.link.response_ms = 6.0;
  SimulatedBench bench = stage.bench();
  const calib::CameraPicture white = look(bench, stage.grey(255));
  const calib::CameraPicture black = look(bench, stage.grey(0));
  EXPECT_GT(middle(white, 0).mean, 0.5);
  EXPECT_LT(middle(black, 0).mean, 1e-4);
}

TEST(SimulatedCamera, CountsLostPicturesWithoutWaiting) {
  Stage stage;
  SimulatedBench bench = stage.bench();
  calib::CameraPicture picture;
  ASSERT_EQ(bench.camera().grab(picture, kLong), calib::GrabStatus::Ready);
  const uint64_t first = picture.sequence;
  const calib::Nanoseconds before = bench.camera().now();
  EXPECT_EQ(bench.camera().grab(picture, calib::Nanoseconds(1000)), calib::GrabStatus::TimedOut);
  EXPECT_EQ(bench.camera().now() - before, calib::Nanoseconds(1000));
  for (int i = 0; i < 12; ++i) {  // 200 ms of vblanks: six camera pictures
    ASSERT_EQ(bench.sink().show(stage.grey(0).view(), kLong), frames::ShowResult::Shown);
  }
  ASSERT_EQ(bench.camera().grab(picture, kLong), calib::GrabStatus::Ready);
  EXPECT_GE(picture.sequence, first + 5);
  EXPECT_LE(picture.sequence, first + 8);
  EXPECT_EQ(bench.sink().show(stage.grey(0).view(), calib::Nanoseconds(10)),
            frames::ShowResult::TimedOut);
}

TEST(SimulatedCamera, IsGoneWhenUnplugged) {
  Stage stage;
  SimulatedBench bench = stage.bench();
  bench.unplug_after(2);
  calib::CameraPicture picture;
  EXPECT_EQ(bench.camera().grab(picture, kLong), calib::GrabStatus::Ready);
  EXPECT_EQ(bench.camera().failure(), "");
  EXPECT_EQ(bench.camera().grab(picture, kLong), calib::GrabStatus::Ready);
  EXPECT_EQ(bench.camera().grab(picture, kLong), calib::GrabStatus::Gone);
  EXPECT_EQ(bench.camera().grab(picture, kLong), calib::GrabStatus::Gone);
  EXPECT_NE(bench.camera().failure(), "");
}

TEST(SimulatedCamera, IsReproducibleBySeedForAnyNumberOfThreads) {
  Stage stage;
  stage.sheet.bubbles = 0.05;
  stage.sheet.deformation_lenses = 0.1;
  stage.camera.bayer = true;
  stage.camera.read_noise = 0.02;
  stage.camera.jpeg_quality = 80;
  stage.camera.shake_mm = 1.0;
  const frames::WovenFrame fringes = fringe_frame(stage.panel, 7.9, 0.25, 0.0);
  SimulatedBench one(stage.panel, stage.sheet, stage.link, stage.camera, 1);
  one.set_threads(1);
  SimulatedBench three(stage.panel, stage.sheet, stage.link, stage.camera, 1);
  three.set_threads(3);
  const calib::CameraPicture first = look(one, fringes);
  EXPECT_EQ(first.light, look(three, fringes).light);
  EXPECT_NE(first.light, stage.see(fringes, 2).light);
}

TEST(SimulatedCamera, ShakesFromFrameToFrame) {
  Stage stage;
  stage.camera.samples = 30;
  const frames::WovenFrame fringes = fringe_frame(stage.panel, 7.9, 0.25, 0.0);
  SimulatedBench still = stage.bench();
  EXPECT_EQ(look(still, fringes).light, look(still, fringes).light);
  stage.camera.shake_mm = 5.0;
  SimulatedBench shaken = stage.bench();
  EXPECT_GT(difference(look(shaken, fringes), look(shaken, fringes)), 0.03);
}

TEST(SimulatedCamera, MovesToTheRequestedPlace) {
  Stage stage;
  SimulatedBench bench = stage.bench();
  const calib::CameraPicture before = look(bench, stage.grey(255));
  bench.move_camera({20, 15, 800}, {0, 0, 0}, 0.0);
  const calib::CameraPicture after = look(bench, stage.grey(255));
  // The panel looks half as wide at twice the distance: the outer area is dark now.
  EXPECT_GT(statistics(before, 0, 0.18, 0.45, 0.24, 0.55).mean, 0.6);
  EXPECT_EQ(statistics(after, 0, 0.18, 0.45, 0.24, 0.55).mean, 0.0);
  EXPECT_EQ(bench.ground_truth_camera().position_mm.z, 800.0);
  EXPECT_THROW(bench.move_camera({0, 0, -5}, {0, 0, -10}, 0.0), Error);
}

TEST(SimulatedBench, RefusesImpossibleOptions) {
  Stage stage;
  stage.sheet.radius_mm = 0.1;  // lenses wider than their cylinders
  EXPECT_THROW((void)stage.see(stage.grey(0)), Error);
  stage = Stage();
  stage.sheet.thickness_mm = std::nan("");
  EXPECT_THROW((void)stage.see(stage.grey(0)), Error);
  stage = Stage();
  stage.link.pwm_duty = 0.0;
  EXPECT_THROW((void)stage.see(stage.grey(0)), Error);
  stage = Stage();
  stage.camera.ambient = std::nan("");
  EXPECT_THROW((void)stage.see(stage.grey(0)), Error);
  stage = Stage();
  SimulatedBench bench = stage.bench();
  EXPECT_THROW(bench.set_thermal_stretch(std::nan("")), Error);
  stage.camera.samples = 0;
  EXPECT_THROW((void)stage.see(stage.grey(0)), Error);
}

TEST(RandomBench, DrawsOnlyValidOptions) {
  PortableRandom random(11);
  optics::Panel panel;
  panel.width_px = 3840;
  panel.height_px = 2160;
  panel.pixel_width = panel.pixel_height = Millimetres(0.15565);
  double finest = 40.0;
  double coarsest = 4.0;
  for (int n = 0; n < 300; ++n) {
    const SimulatedSheet sheet = random_sheet(random, panel);
    EXPECT_NO_THROW(check_sheet(sheet, panel));
    const SimulatedCamera camera = random_camera(random, panel, n % 3);
    EXPECT_NO_THROW(check_camera(camera));
    EXPECT_NEAR(camera.position_mm.x, (n % 3 - 1) * 250.0, 30.0);
    finest = std::min(finest, sheet.pitch_subpx);
    coarsest = std::max(coarsest, sheet.pitch_subpx);
  }
  EXPECT_LT(finest, 4.5);
  EXPECT_GT(coarsest, 35.0);
}

}  // namespace
}  // namespace lenticule::lab
