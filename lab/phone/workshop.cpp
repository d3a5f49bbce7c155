// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/workshop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include "lab/panel/simulated_sensor.h"
#include "optics/model.h"

namespace lenticule::lab {
namespace {

/// Draws returns random numbers that are the same on every machine.
class Draws {
 public:
  explicit Draws(uint64_t seed) : bits_(seed) {}
  double between(double least, double most) {
    return least + (most - least) * static_cast<double>(bits_() >> 11) * 0x1p-53;
  }
  double around(double reach) { return between(-reach, reach); }
  uint64_t whole() { return bits_(); }

 private:
  std::mt19937_64 bits_;
};

optics::Panel panel_of(const WorkshopLimits& limits) {
  constexpr double kInch = 25.4;
  optics::Panel panel;
  panel.width_px = limits.panel_width;
  panel.height_px = limits.panel_width * 9 / 16;
  const double pixel = limits.diagonal_inches * kInch / std::hypot(panel.width_px, panel.height_px);
  panel.pixel_width = panel.pixel_height = Millimetres(pixel);
  return panel;
}

/// Returns the index at red (610 nm), green (546 nm) or blue (460 nm), by Cauchy's formula A + B /
/// wavelength^2 with B from the Abbe number (n_d - 1) / (n_F - n_C), lines of 588, 486 and 656 nm.
std::array<double, 3> indices_of(double green, double abbe) {
  const auto term = [](double micrometres) { return 1.0 / (micrometres * micrometres); };
  const double b = (green - 1.0) / abbe / (term(0.486) - term(0.656));
  return {green + b * (term(0.610) - term(0.546)), green, green + b * (term(0.460) - term(0.546))};
}

SimulatedSheet build_of(Draws& draw, const WorkshopLimits& limits, const optics::Panel& panel) {
  SimulatedSheet build;
  build.pitch_subpx = draw.between(limits.least_pitch_subpx, limits.most_pitch_subpx);
  build.slant = draw.around(0.4);
  build.offset_lenses = draw.around(0.5);
  const double abbe = draw.between(35.0, 57.0);  // PETG, acrylic
  const double green = draw.between(1.49, 1.57);
  build.index = indices_of(green, abbe);
  const double cone = draw.between(9.0, 16.0) * std::numbers::pi / 180.0;
  const double pitch_mm =
      build.pitch_subpx * panel.pixel_width.value / 3.0 / std::hypot(1.0, build.slant);
  const double gap = pitch_mm / (2.0 * std::tan(0.5 * cone));
  // Glass and polariser are between sheet and pixels.
  build.gap_index = 1.52;
  build.gap_mm = std::min(draw.between(0.4, 0.7), 0.5 * gap * build.gap_index);
  build.thickness_mm = (gap - build.gap_mm / build.gap_index) * green;
  // A single surface focuses at n R / (n - 1) in its medium; the pixels are beyond by up to 8 %.
  const double defocus = draw.around(0.08);
  const double length = build.thickness_mm + build.gap_mm * green / build.gap_index;
  build.radius_mm = std::max(length / (1.0 + defocus) * (green - 1.0) / green, 0.55 * pitch_mm);
  build.valley = draw.between(0.02, 0.06);
  build.haze = draw.between(0.02, 0.08);
  build.black_matrix = 0.36;
  for (double& amplitude : build.bend_lenses) amplitude = draw.around(0.03);
  return build;
}

optics::Rig start_of(Draws& draw, const SimulatedSheet& build, const optics::Panel& panel,
                     double distance) {
  optics::Rig start;
  start.name = "workshop";
  start.panel = panel;
  start.viewing.distance = Millimetres(distance);
  start.sheet.pitch = Subpixels(build.pitch_subpx * (1.0 + draw.around(0.03)));
  start.sheet.slant = build.slant + draw.around(0.01);
  start.sheet.gap = Millimetres(chief_ray(build, 1).gap_mm * (1.0 + draw.around(0.1)));
  start.sheet.refraction_shape = 0.45;
  return start;
}

/// Returns a smooth random displacement with this root mean square over the picture.
std::vector<Wave> warp_of(Draws& draw, double rms) {
  constexpr int kWaves = 6;
  std::vector<Wave> waves(kWaves);
  double squares = 0.0;
  for (Wave& wave : waves) {
    wave.turns_per_side = {draw.around(1.2), draw.around(1.2)};
    wave.turns = draw.around(0.5);
    wave.shift = {draw.around(1.0), draw.around(1.0)};
    squares += 0.5 * (wave.shift.x * wave.shift.x + wave.shift.y * wave.shift.y);
  }
  for (Wave& wave : waves) wave.shift = wave.shift * (rms / std::sqrt(squares));
  return waves;
}

/// Sets what makes a phone more than a pinhole with radial distortion. A stream of its own keeps
/// the other draws of a seed.
void make_real(Draws draw, const WorkshopLimits& limits, Workshop& workshop) {
  workshop.phone.tangential = {draw.around(0.0003), draw.around(0.0003)};
  workshop.phone.warp = warp_of(draw, draw.between(limits.least_warp, limits.most_warp));
  for (Shot& shot : workshop.shots) {
    const double kind = draw.between(0.0, 1.0), turn = draw.around(std::numbers::pi);
    const double shift = kind < 0.6 ? 0.0012 : kind < 0.9 ? 0.002 : 0.003;
    shot.stabilisation = {shift * std::cos(turn), shift * std::sin(turn)};
  }
}

Phone phone_of(Draws& draw, const WorkshopLimits& limits) {
  Phone phone;
  phone.width = limits.phone_width;
  phone.height = limits.phone_width * 3 / 4;
  phone.focal = draw.between(0.68, 0.82);
  phone.stated_focal = 1.0 + draw.around(0.03);
  phone.axis = {draw.around(0.008), draw.around(0.008)};
  phone.radial1 = draw.around(0.04);
  phone.radial2 = draw.around(0.03);
  phone.readout_s = draw.between(0.01, 0.03);
  phone.vignetting = draw.between(0.1, 0.4);
  phone.shot_noise = draw.between(0.005, 0.02);
  phone.read_noise = draw.between(0.002, 0.008);
  phone.blur_px = draw.between(1.2, 2.2);
  phone.sharpening = draw.between(0.2, 1.0);
  phone.tone_mapping = draw.between(0.0, 0.25);
  phone.curve = draw.between(0.0, 0.1);
  phone.exposure = draw.between(0.3, 0.5);
  phone.jpeg_quality = static_cast<int>(draw.between(85.0, 97.0));
  return phone;
}

Shot shot_of(Draws& draw, int number, double distance, double panel_width_mm) {
  struct Place {
    double x, y, z, roll;
  };
  // Parts of the viewing distance; degrees.
  constexpr std::array<Place, 6> kPlaces = {{{0.0, 0.05, 1.0, 180.0},
                                             {-0.5, 0.4, 1.0, 0.0},
                                             {0.5, 0.4, 1.0, 0.0},
                                             {0.5, 0.4, 0.95, 180.0},
                                             {-0.5, 0.4, 0.95, 180.0},
                                             {0.0, 0.2, 1.0, 0.0}}};
  const Place& place = kPlaces[static_cast<size_t>(number) % kPlaces.size()];
  Shot shot;
  shot.eye_mm = {distance * place.x + draw.around(50.0), distance * place.y + draw.around(40.0),
                 distance * place.z * (1.0 + draw.around(0.06))};
  shot.look_at_mm = {panel_width_mm * draw.around(0.05), panel_width_mm * draw.around(0.05)};
  shot.roll_degrees = place.roll + draw.around(4.0);
  shot.breathing = draw.between(0.0, 0.015);
  draw.whole();
  draw.whole();
  shot.drift_mm_s = {draw.around(6.0), draw.around(6.0), draw.around(6.0)};
  shot.turn_degrees_s = {draw.around(0.6), draw.around(0.6), draw.around(0.6)};
  shot.room_light = draw.between(0.005, 0.05);
  shot.seed = draw.whole();
  return shot;
}

}  // namespace

WorkshopLimits limits_for(int panel_width, int phone_width) {
  WorkshopLimits limits;
  const double part = std::min(static_cast<double>(panel_width) / limits.panel_width, 1.0);
  limits.panel_width = panel_width;
  limits.phone_width = phone_width;
  limits.most_pitch_subpx *= part;
  limits.least_pitch_subpx = std::min(limits.least_pitch_subpx, 0.75 * limits.most_pitch_subpx);
  return limits;
}

Workshop draw_workshop(uint64_t seed, const WorkshopLimits& limits) {
  Draws draw(seed * 7919 + 17);
  Workshop workshop;
  const optics::Panel panel = panel_of(limits);
  const double width = panel.width_px * panel.pixel_width.value;
  // Near enough that the panel fills the picture of a usual phone.
  const double distance = width * draw.between(1.1, 1.35);
  workshop.build = build_of(draw, limits, panel);
  workshop.start = start_of(draw, workshop.build, panel, distance);
  workshop.phone = phone_of(draw, limits);
  for (int n = 0; n < limits.shots; ++n)
    workshop.shots.push_back(shot_of(draw, n, distance, width));
  make_real(Draws(seed * 104729 + 71), limits, workshop);
  return workshop;
}

double Sweep::Wobble::at(double seconds) const {
  double sum = 0.0;
  for (size_t k = 0; k < size.size(); ++k)
    sum += size[k] * std::sin(2.0 * std::numbers::pi * (hertz[k] * seconds + phase[k]));
  return sum;
}

Sweep::Sweep(uint64_t seed, const Workshop& workshop)
    : seed_(seed), distance_(workshop.start.viewing.distance.value) {
  Draws draw(seed * 15485863 + 29);
  seconds_ = draw.between(6.0, 12.0);
  room_light_ = draw.between(0.005, 0.05);
  breathing_ = draw.between(0.0, 0.015);
  exposure_s_ = draw.between(0.002, 0.008);
  stabilisation_ = draw.between(0.0, 1.0) < 0.5 ? 0.0 : 0.0012;
  stabilisation_turn_ = draw.around(1.0);
  // Millimetres, then degrees: a slow sway, a wobble, and the tremor of muscles.
  for (size_t k = 0; k < wobble_.size(); ++k) {
    const double unit = k == 5 ? 0.4 : 1.0;
    wobble_[k] = {
        .size = {unit * draw.between(3.0, 10.0), unit * draw.between(0.5, 2.5),
                 unit * draw.between(0.0, 0.1)},
        .hertz = {draw.between(0.1, 0.5), draw.between(0.5, 2.0), draw.between(6.0, 10.0)},
        .phase = {draw.around(0.5), draw.around(0.5), draw.around(0.5)}};
  }
}

Shot Sweep::still(double seconds) const {
  const double part = -std::cos(std::numbers::pi * seconds / seconds_);  // -1 at the left
  Shot shot;
  shot.eye_mm = {0.55 * distance_ * part + wobble_[0].at(seconds),
                 distance_ * (0.05 + 0.35 * part * part) + wobble_[1].at(seconds),
                 distance_ * (1.02 - 0.08 * part * part) + wobble_[2].at(seconds)};
  shot.look_at_mm = {wobble_[3].at(seconds), wobble_[4].at(seconds)};
  shot.roll_degrees = wobble_[5].at(seconds);
  return shot;
}

Shot Sweep::at(double seconds) const {
  constexpr double kStep = 1e-3;
  Shot shot = still(seconds);
  const Shot before = still(seconds - kStep), after = still(seconds + kStep);
  shot.drift_mm_s = (after.eye_mm - before.eye_mm) * (0.5 / kStep);
  const auto rays = [](const Shot& at) {
    SimulatedCamera camera;
    camera.position_mm = at.eye_mm;
    camera.look_at_mm = {at.look_at_mm.x, at.look_at_mm.y, 0.0};
    camera.roll_degrees = at.roll_degrees;
    return CameraRays(camera);
  };
  const CameraRays from = rays(before), to = rays(after), now = rays(shot);
  const auto turned = [&](Vec3 axis, Vec3 to_axis) {
    return dot(to.from_camera(axis) - from.from_camera(axis), now.from_camera(to_axis)) /
           (2.0 * kStep) * 180.0 / std::numbers::pi;
  };
  const Vec3 right{1, 0, 0}, down{0, 1, 0}, forward{0, 0, 1};
  // A rotation w moves an axis a by w x a.
  shot.turn_degrees_s = {turned(down, forward), turned(forward, right), turned(right, down)};
  shot.breathing = breathing_;
  shot.exposure_s = exposure_s_;
  const double turn = 2.0 * std::numbers::pi * (stabilisation_turn_ + 0.2 * seconds);
  shot.stabilisation = {stabilisation_ * std::cos(turn), stabilisation_ * std::sin(turn)};
  shot.room_light = room_light_;
  shot.seed = seed_ * 100003 + static_cast<uint64_t>(std::lround(1000.0 * seconds));
  return shot;
}

void make_film_camera(uint64_t seed, int width, Phone& phone) {
  Draws draw(seed * 32452843 + 11);
  phone.width = width;
  phone.height = width * 9 / 16;
  phone.focal *= draw.between(1.0, 1.2);  // a film uses less of the sensor
  phone.jpeg_quality = 80;
}

std::vector<Vec3> judged_eyes(const optics::Rig& start) {
  std::vector<Vec3> eyes;
  for (const double z : {0.8, 1.0, 1.2})
    for (const double x : {-250.0, -125.0, 0.0, 125.0, 250.0})
      eyes.push_back({x, start.viewing.height.value, z * start.viewing.distance.value});
  return eyes;
}

double worst_error(const optics::Rig& rig, const SheetShape& sheet, const std::vector<Vec3>& eyes) {
  constexpr int kColumns = 29, kRows = 17, kGreen = 1;
  const optics::OpticalModel model(rig);
  const optics::Panel& panel = rig.panel;
  double worst = 0.0;
  for (const Vec3& eye : eyes)
    for (int r = 0; r < kRows; ++r)
      for (int c = 0; c < kColumns; ++c) {
        const double x = panel.width_px * (0.01 + 0.98 * c / (kColumns - 1));
        const double y = panel.height_px * (0.01 + 0.98 * r / (kRows - 1));
        const std::optional<TrueView> seen =
            true_view(sheet, {panel.x_mm(x), panel.y_mm(y)}, kGreen, eye, LightMiddle::Centroid);
        if (!seen) return std::numeric_limits<double>::infinity();
        const double off = model.phase(x, y, kGreen, {eye.x, eye.y, eye.z}) - seen->phase;
        worst = std::max(worst, std::abs(off - std::round(off)));
      }
  return worst;
}

}  // namespace lenticule::lab
