// SPDX-License-Identifier: Apache-2.0
// Draws random sheets, cameras and links.
#include "calib/simulation/random_bench.h"

#include <array>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace lenticule::calib {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kDistanceMm = 700.0;
constexpr std::array<double, 3> kSidewaysMm{-250.0, 0.0, 250.0};

/// Draws a lens that focuses on the pixels: thickness and radius follow from the cone and the
/// index.
void draw_lens(PortableRandom& random, const optics::Panel& panel, SimulatedSheet& sheet) {
  const double green = random.uniform(1.45, 1.60);
  const double dispersion = random.uniform(0.002, 0.006);
  sheet.index = {green - dispersion, green, green + dispersion};
  const double slant_mm = sheet.slant * panel.pixel_width.value / panel.pixel_height.value;
  const double across_mm =
      sheet.pitch_subpx / 3.0 * panel.pixel_width.value / std::hypot(1.0, slant_mm);
  const double cone = random.uniform(8.0, 24.0) * kDegree;
  const double gap_mm = across_mm / (2.0 * std::tan(cone / 2.0));
  sheet.radius_mm = gap_mm * (green - 1.0);
  sheet.thickness_mm = green * gap_mm * random.uniform(0.95, 1.05);
}

void draw_sensor(PortableRandom& random, SimulatedCamera& camera) {
  const double noise = random.uniform(0.01, 0.05);
  const double shot_part = random.uniform(0.3, 0.9);
  camera.shot_noise = noise * std::sqrt(shot_part);
  camera.read_noise = noise * std::sqrt(1.0 - shot_part);
  const double leak = random.uniform(0.0, 0.15);  // leak to the neighbouring colour
  camera.response = {{{1.0, leak, 0.0}, {leak, 1.0, leak}, {0.0, leak, 1.0}}};
  const bool compressed = random.uniform() < 0.7;
  camera.jpeg_quality = compressed ? static_cast<int>(random.uniform(80.0, 96.0)) : 0;
  camera.rolling_shutter_ms = 15.0;
  camera.exposure_ms = 1000.0 / 60.0;
}

}  // namespace

SimulatedSheet random_sheet(PortableRandom& random, const optics::Panel& panel) {
  SimulatedSheet sheet;
  sheet.pitch_subpx =
      4.0 * std::pow(10.0, random.uniform());  // fine pitches are as likely as coarse ones
  sheet.slant = std::tan(random.uniform(-30.0, 30.0) * kDegree);
  sheet.offset_lenses = random.uniform(-0.5, 0.5);
  draw_lens(random, panel, sheet);
  sheet.deformation_lenses = random.uniform(0.0, 0.15);
  sheet.black_matrix = random.uniform(0.1, 0.5);
  sheet.seed = random.bits();
  return sheet;
}

void random_place(PortableRandom& random, int viewpoint, SimulatedCamera& camera) {
  LENTICULE_CHECK(viewpoint >= 0 && viewpoint < 3);
  const double sideways = kSidewaysMm[static_cast<size_t>(viewpoint)];
  camera.position_mm = {sideways + random.uniform(-30.0, 30.0), random.uniform(-30.0, 30.0),
                        kDistanceMm + random.uniform(-30.0, 30.0)};
  camera.look_at_mm = {random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0), 0.0};
  camera.roll_degrees = random.uniform(-3.0, 3.0);
}

SimulatedCamera random_camera(PortableRandom& random, const optics::Panel& panel, int viewpoint) {
  SimulatedCamera camera;
  random_place(random, viewpoint, camera);
  const double part = random.uniform(0.55, 0.80);
  const double panel_mm = panel.width_px * panel.pixel_width.value;
  camera.focal_px = part * camera.width * kDistanceMm / panel_mm;
  camera.centre_x_px = camera.width / 2.0 + random.uniform(-20.0, 20.0);
  camera.centre_y_px = camera.height / 2.0 + random.uniform(-20.0, 20.0);
  camera.k1 = random.uniform(-0.05, 0.05);
  camera.psf_sigma_px = random.uniform(0.4, 1.2);
  draw_sensor(random, camera);
  return camera;
}

SimulatedPanelLink random_link(PortableRandom& random) {
  SimulatedPanelLink link;
  link.response_ms = random.uniform(5.0, 10.0);
  return link;
}

}  // namespace lenticule::calib
