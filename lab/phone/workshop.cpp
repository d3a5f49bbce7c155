// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/workshop.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

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

SheetBuild build_of(Draws& draw, const WorkshopLimits& limits, const optics::Panel& panel) {
  SheetBuild build;
  build.pitch_subpx = draw.between(limits.least_pitch_subpx, limits.most_pitch_subpx);
  build.slant = draw.around(0.4);
  build.offset_lenses = draw.around(0.5);
  build.abbe = draw.between(35.0, 57.0);
  build.sheet_index = draw.between(1.49, 1.57);
  const double cone = draw.between(9.0, 16.0) * std::numbers::pi / 180.0;
  const double pitch_mm =
      build.pitch_subpx * panel.pixel_width.value / 3.0 / std::hypot(1.0, build.slant);
  const double gap = pitch_mm / (2.0 * std::tan(0.5 * cone));
  build.glass_mm = std::min(draw.between(0.4, 0.7), 0.5 * gap * build.glass_index);
  build.sheet_mm = (gap - build.glass_mm / build.glass_index) * build.sheet_index;
  build.defocus = draw.around(0.08);
  build.valley = draw.between(0.02, 0.06);
  build.haze = draw.between(0.02, 0.08);
  for (double& amplitude : build.deformation) amplitude = draw.around(0.03);
  return build;
}

optics::Rig start_of(Draws& draw, const SheetBuild& build, const optics::Panel& panel,
                     double distance) {
  optics::Rig start;
  start.name = "workshop";
  start.panel = panel;
  start.viewing.distance = Millimetres(distance);
  start.sheet.pitch = Subpixels(build.pitch_subpx * (1.0 + draw.around(0.03)));
  start.sheet.slant = build.slant + draw.around(0.01);
  const double gap = build.sheet_mm / build.sheet_index + build.glass_mm / build.glass_index;
  start.sheet.gap = Millimetres(gap * (1.0 + draw.around(0.1)));
  start.sheet.refraction_shape = 0.45;
  return start;
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
  shot.stabilisation = {draw.around(0.002), draw.around(0.002)};
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
  return workshop;
}

std::vector<Vec3> judged_eyes(const optics::Rig& start) {
  std::vector<Vec3> eyes;
  for (const double z : {0.8, 1.0, 1.2})
    for (const double x : {-250.0, 0.0, 250.0})
      eyes.push_back({x, start.viewing.height.value, z * start.viewing.distance.value});
  return eyes;
}

namespace {

/// Fits g t / sqrt(1 + (1 - nu) (t^2 + v^2)), the law of rigs, to the light's way through whole
/// lenses, for tangents t across the lenses up to 0.9 and v along them up to 0.4.
void fit_law(const LensSection& sheet, optics::LensSheet& out) {
  constexpr int kGreen = 1;
  struct Seen {
    double across, along, shift;
  };
  std::vector<Seen> seen;
  for (const double along : {0.0, 0.2, 0.4})
    for (int k = -18; k <= 18; ++k)
      if (k != 0)
        seen.push_back({0.05 * k, along, -sheet.mean_shift(0.05 * k, along, kGreen).across});
  double best = std::numeric_limits<double>::infinity();
  for (double shape = 0.0; shape <= 1.0; shape += 0.002) {
    const auto term = [&](const Seen& s) {
      return s.across / std::sqrt(1.0 + (1.0 - shape) * (s.across * s.across + s.along * s.along));
    };
    double product = 0.0, square = 0.0, rest = 0.0;
    for (const Seen& s : seen) {
      product += s.shift * term(s);
      square += term(s) * term(s);
    }
    const double gap = product / square;
    for (const Seen& s : seen) rest += std::pow(s.shift - gap * term(s), 2);
    if (rest >= best) continue;
    best = rest;
    out.gap = Millimetres(gap);
    out.refraction_shape = shape;
  }
}

}  // namespace

optics::Rig rig_of_build(const LensSection& sheet, const optics::Rig& start) {
  const SheetBuild& build = sheet.build();
  optics::Rig rig = start;
  rig.sheet.pitch = Subpixels(build.pitch_subpx);
  rig.sheet.slant = build.slant;
  rig.sheet.offset = Lenses(build.offset_lenses);
  fit_law(sheet, rig.sheet);
  optics::ResidualMap map;
  map.columns = 24;
  map.rows = 14;
  const auto along = [](int k, int count, double size_mm) {
    return size_mm * (static_cast<double>(k) / (count - 1) - 0.5);
  };
  SheetBuild flat = build;
  flat.deformation.fill(0.0);
  const LensSection plane(flat, sheet.panel());
  for (int r = 0; r < map.rows; ++r)
    for (int c = 0; c < map.columns; ++c) {
      const Vec2 at{along(c, map.columns, rig.panel.width_px * rig.panel.pixel_width.value),
                    -along(r, map.rows, rig.panel.height_px * rig.panel.pixel_height.value)};
      map.lenses.push_back(sheet.lens_coordinate(at) - plane.lens_coordinate(at));
    }
  rig.sheet.residual = map;
  return rig;
}

double worst_error(const optics::Rig& rig, const LensSection& sheet,
                   const std::vector<Vec3>& eyes) {
  constexpr int kColumns = 13, kRows = 9, kGreen = 1;
  const optics::OpticalModel model(rig);
  const optics::Panel& panel = rig.panel;
  double worst = 0.0;
  for (const Vec3& eye : eyes)
    for (int r = 0; r < kRows; ++r)
      for (int c = 0; c < kColumns; ++c) {
        const double x = panel.width_px * (0.01 + 0.98 * c / (kColumns - 1));
        const double y = panel.height_px * (0.01 + 0.98 * r / (kRows - 1));
        const double off = model.phase(x, y, kGreen, {eye.x, eye.y, eye.z}) -
                           sheet.ground_truth_phase({panel.x_mm(x), panel.y_mm(y)}, kGreen, eye);
        worst = std::max(worst, std::abs(off - std::round(off)));
      }
  return worst;
}

}  // namespace lenticule::lab
