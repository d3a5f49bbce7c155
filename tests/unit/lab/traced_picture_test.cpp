// SPDX-License-Identifier: Apache-2.0
// Tests the camera's picture against the ground truth of the same bench: two independent
// computations with the same lenses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "bench_stage.h"
#include "lab/panel/simulated_bench.h"

namespace lenticule::lab {
namespace {

constexpr int kSteps = 4;
/// Half of the error is noise of the 20 rays per pixel: with ten times as many, 0.0003 to 0.001
/// remain.
constexpr double kMostError = 0.0025;
constexpr int kHalfWindow = 6;  // camera pixels: two millimetres, over which a sheet is straight
using ComplexPicture = std::vector<std::complex<double>>;

/// Returns the phase of fringes at every camera pixel, from four pictures with stepped fringes.
ComplexPicture step_fringes(SimulatedBench& bench, const optics::Panel& panel, double pitch_subpx,
                            double slant, int channel) {
  ComplexPicture sum;
  for (int step = 0; step < kSteps; ++step) {
    const double cycles = static_cast<double>(step) / kSteps;
    const calib::CameraPicture picture =
        look(bench, fringe_frame(panel, pitch_subpx, slant, cycles));
    sum.resize(static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height));
    for (size_t pixel = 0; pixel < sum.size(); ++pixel) {
      const double light = picture.light[pixel * static_cast<size_t>(picture.channels) +
                                         static_cast<size_t>(picture.channels == 3 ? channel : 0)];
      sum[pixel] += light * std::polar(1.0, -2.0 * std::numbers::pi * cycles);
    }
  }
  return sum;
}

std::complex<double> mean_around(const ComplexPicture& picture, int width, Vec2 at, int half) {
  std::complex<double> sum;
  const int column = static_cast<int>(std::lround(at.x));
  const int row = static_cast<int>(std::lround(at.y));
  for (int j = row - half; j < row + half; ++j) {
    for (int i = column - half; i < column + half; ++i) {
      sum += picture[static_cast<size_t>(j) * static_cast<size_t>(width) + static_cast<size_t>(i)];
    }
  }
  return sum / (4.0 * half * half);
}

double wrapped(double cycles) { return cycles - std::round(cycles); }

/// Returns the root mean square difference over the panel between the fringes in the picture and
/// the fringes by the ground truth.
double phase_error(const optics::Panel& panel, const SimulatedSheet& sheet,
                   const SimulatedCamera& camera, int channel) {
  SimulatedBench bench(panel, sheet, {}, camera, 5);
  const double distance = camera.position_mm.z;
  const double pitch = sheet.pitch_subpx * (1.0 + chief_ray(sheet, channel).gap_mm / distance);
  const ComplexPicture seen = step_fringes(bench, panel, pitch, sheet.slant, channel);
  double squares = 0.0;
  int places = 0;
  for (double y = 40; y < panel.height_px; y += 93) {
    for (double x = 40; x < panel.width_px; x += 93) {
      const std::optional<Vec2> at = bench.ground_truth_in_picture(x, y);
      if (!at) return 1.0;
      const double decoded =
          std::arg(mean_around(seen, camera.width, *at, kHalfWindow)) / (2.0 * std::numbers::pi);
      const double s =
          3.0 * ((x - panel.width_px / 2.0) + sheet.slant * (y - panel.height_px / 2.0));
      const double ground_truth =
          bench.ground_truth_phase(x, y, channel, camera.position_mm, LightMiddle::FringePhase);
      const double expected = s / pitch - ground_truth;
      const double error = wrapped(decoded - expected);
      squares += error * error;
      ++places;
    }
  }
  return std::sqrt(squares / places);
}

SimulatedCamera oblique_camera() {
  SimulatedCamera camera = quiet_camera();
  camera.position_mm = {-70, 40, 390};
  camera.roll_degrees = 3.0;
  camera.k1 = -0.05;
  camera.samples = 20;
  return camera;
}

TEST(TracedPicture, ShowsTheTruePhase) {
  const optics::Panel panel = small_panel();
  EXPECT_LT(phase_error(panel, focused_sheet(panel, 7.7, 0.25), oblique_camera(), 1), kMostError);
}

TEST(TracedPicture, ShowsTheTruePhaseOfADeformedAndBowedSheet) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 9.3, -0.4);
  sheet.deformation_lenses = 0.15;
  sheet.gap_bow = 0.05;
  EXPECT_LT(phase_error(panel, sheet, oblique_camera(), 1), kMostError);
}

TEST(TracedPicture, ShowsTheTruePhaseOfACurvedPanel) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  sheet.curve_radius_mm = 600.0;
  EXPECT_LT(phase_error(panel, sheet, oblique_camera(), 1), kMostError);
}

TEST(TracedPicture, ShowsTheTruePhaseOfLensesThatFaceThePanel) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  sheet.lens_toward_panel = true;
  sheet.gap_mm = sheet.radius_mm / (sheet.index[1] - 1.0);
  EXPECT_LT(phase_error(panel, sheet, oblique_camera(), 1), kMostError);
}

TEST(TracedPicture, ShowsEachColourThroughItsOwnIndex) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  sheet.index = {1.46, 1.50, 1.54};  // strong dispersion to separate the colours
  SimulatedCamera camera = oblique_camera();
  camera.bayer = true;
  EXPECT_LT(phase_error(panel, sheet, camera, 2), kMostError);
  const SimulatedBench bench(panel, sheet, {}, camera, 5);
  const double red = bench.ground_truth_phase(600, 180, 0, camera.position_mm);
  EXPECT_GT(std::abs(red - bench.ground_truth_phase(600, 180, 2, camera.position_mm)), 0.03);
}

/// Returns a frame that lights, in the middle of the panel, the subpixels whose true phase is
/// within `reach` of a lens's centre plus `middle`.
frames::WovenFrame comb_frame(const SimulatedBench& bench, const optics::Panel& panel,
                              double middle, double reach, Vec3 eye) {
  frames::WovenFrame frame({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  for (int j = panel.height_px * 3 / 10; j < panel.height_px * 7 / 10; ++j) {
    for (int i = panel.width_px * 3 / 10; i < panel.width_px * 7 / 10; ++i) {
      for (int channel = 0; channel < 3; ++channel) {
        const Vec2 at = panel.subpixel_centre_px(i, j, channel);
        const double phase = bench.ground_truth_phase(at.x, at.y, channel, eye);
        const bool lit = std::abs(wrapped(phase - middle)) < reach;
        frame.row(j)[i * 3 + channel] = lit ? 255 : 0;
      }
    }
  }
  return frame;
}

double mean_of_middle(const calib::CameraPicture& picture) {
  double sum = 0.0;
  int count = 0;
  for (int row = picture.height * 2 / 5; row < picture.height * 3 / 5; ++row) {
    for (int column = picture.width * 2 / 5; column < picture.width * 3 / 5; ++column, ++count) {
      sum += double{light_at(picture, column, row, picture.channels / 2)};
    }
  }
  return sum / count;
}

TEST(TracedPicture, AFocusedLensShowsOnlyTheColumnBehindIt) {
  const optics::Panel panel = small_panel(320, 180);
  const SimulatedSheet sheet = focused_sheet(panel, 12.3, 0.25);
  const SimulatedCamera camera = quiet_camera(320, 240);
  SimulatedBench bench(panel, sheet, {}, camera, 3);
  const Vec3 eye = camera.position_mm;
  const double seen = mean_of_middle(look(bench, comb_frame(bench, panel, 0.0, 0.2, eye)));
  const double unseen = mean_of_middle(look(bench, comb_frame(bench, panel, 0.5, 0.2, eye)));
  EXPECT_GT(seen, 0.9 * camera.white_light);
  EXPECT_LT(unseen, 0.01 * camera.white_light);
}

TEST(TracedPicture, AnUnfocusedLensShowsMore) {
  const optics::Panel panel = small_panel(320, 180);
  SimulatedSheet sheet = focused_sheet(panel, 12.3, 0.25);
  sheet.radius_mm *= 2.0;  // half the power: the light of the panel spreads over half the lens
  const SimulatedCamera camera = quiet_camera(320, 240);
  SimulatedBench bench(panel, sheet, {}, camera, 3);
  const Vec3 eye = camera.position_mm;
  const double unseen = mean_of_middle(look(bench, comb_frame(bench, panel, 0.3, 0.1, eye)));
  EXPECT_GT(unseen, 0.1 * camera.white_light);
}

TEST(TracedPicture, ShowsThePanelAtItsProjection) {
  const optics::Panel panel = small_panel();
  const SimulatedSheet sheet = focused_sheet(panel, 4.1, 0.2, 20.0);
  const SimulatedCamera camera = oblique_camera();
  SimulatedBench bench(panel, sheet, {}, camera, 3);
  for (const Vec2 middle : {Vec2{60, 60}, Vec2{580, 300}}) {
    frames::WovenFrame frame = plain_frame(panel, 0, 0, 0);
    for (int j = -20; j < 20; ++j) {
      uint8_t* row = frame.row(static_cast<int>(middle.y) + j);
      std::fill_n(row + (static_cast<int>(middle.x) - 20) * 3, 120, uint8_t{255});
    }
    const calib::CameraPicture picture = look(bench, frame);
    Vec2 sum;
    double weight = 0.0;
    for (int row = 0; row < picture.height; ++row) {
      for (int column = 0; column < picture.width; ++column) {
        const double light = double{light_at(picture, column, row, 0)};
        sum = sum + Vec2{column + 0.5, row + 0.5} * light;
        weight += light;
      }
    }
    const std::optional<Vec2> expected = bench.ground_truth_in_picture(middle.x, middle.y);
    ASSERT_TRUE(expected);
    EXPECT_NEAR(sum.x / weight, expected->x, 0.3);
    EXPECT_NEAR(sum.y / weight, expected->y, 0.3);
  }
}

}  // namespace
}  // namespace lenticule::lab
