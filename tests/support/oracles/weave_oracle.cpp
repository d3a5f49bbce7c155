// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/weave_oracle.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lenticule::test {
namespace {

using Real = long double;
using frames::PictureFit;
using frames::ViewFilter;
using frames::ViewOrder;

// Each step improves the result by a factor of distance over gap, at least 100.
constexpr int kSteps = 12;

struct Point {
  Real x, y;
};

Point subpixel_mm(const optics::Rig& rig, int i, int j, int channel) {
  const auto centre = rig.panel.subpixel_centre_px(i, j, channel);
  return {Real(rig.panel.pixel_width.value) * (Real(centre.x) - Real(rig.panel.width_px) / 2),
          Real(rig.panel.pixel_height.value) * (Real(rig.panel.height_px) / 2 - Real(centre.y))};
}

/// Returns lambda of a panel point in mm.
Real lens_coordinate(const optics::Rig& rig, Point p, int channel) {
  const Real right_px = p.x / Real(rig.panel.pixel_width.value) +
                        Real(rig.sheet.channel_offset[size_t(channel)].value) / 3;
  const Real down_px = -p.y / Real(rig.panel.pixel_height.value);
  return 3 * (right_px + Real(rig.sheet.slant) * down_px) / Real(rig.sheet.pitch.value) +
         Real(rig.sheet.offset.value);
}

/// Returns L with L - Delta(L, E) = Q for E = (eye_x, Ey, Z), by repeating L = Q + Delta(L).
Point seen_through(const optics::Rig& rig, Point q, Real eye_x) {
  const Real z = rig.viewing.distance.value, height = rig.viewing.height.value;
  const Real kappa = 1 - Real(rig.sheet.refraction_shape);
  Point lens = q;
  for (int step = 0; step < kSteps; ++step) {
    const Point r{eye_x - lens.x, height - lens.y};
    const Real path = std::sqrt(z * z + kappa * (r.x * r.x + r.y * r.y));
    lens = {q.x + Real(rig.sheet.gap.value) * r.x / path,
            q.y + Real(rig.sheet.gap.value) * r.y / path};
  }
  return lens;
}

Real lens_width_mm(const optics::Rig& rig) {
  return Real(rig.sheet.pitch.value) * Real(rig.panel.pixel_width.value) / 3;
}

/// Returns the point where the ray of the subpixel crosses the panel's plane: finds the eye on the
/// viewing line that sees the subpixel on the axis of its lens. The height is the paraxial one by
/// definition.
Point lens_point(const optics::Rig& rig, Point q, Real lens, int channel) {
  const Real z = rig.viewing.distance.value, g = rig.sheet.gap.value;
  if (std::isinf(z))  // straight ahead there is no vertical shift
    return {q.x + (lens - lens_coordinate(rig, q, channel)) * lens_width_mm(rig), q.y};
  Real eye_x = 0;
  Point p = seen_through(rig, q, eye_x);
  for (int step = 0; step < kSteps; ++step) {
    const Real error_mm = (lens - lens_coordinate(rig, p, channel)) * lens_width_mm(rig);
    eye_x += error_mm * z / g;  // exact for a thin sheet; the next step reduces the remaining error
    p = seen_through(rig, q, eye_x);
  }
  return {p.x, (q.y * z + g * Real(rig.viewing.height.value)) / (z + g)};
}

Real light_of(uint8_t code) {
  static const std::array<Real, 256> kLight = [] {
    std::array<Real, 256> light{};
    for (size_t n = 0; n < light.size(); ++n) {
      const Real v = Real(n) / 255;
      light[n] = v <= 0.04045L ? v / 12.92L : std::pow((v + 0.055L) / 1.055L, 2.4L);
    }
    return light;
  }();
  return kLight[code];
}
Real code_of(Real light) {
  const Real v = light <= 0.0031308L ? light * 12.92L : 1.055L * std::pow(light, 1 / 2.4L) - 0.055L;
  return 255 * v;
}

Real tent(Real distance) { return std::max(Real(0), 1 - std::abs(distance)); }

Real clamp_to(Real v, Real low, Real high) { return std::min(std::max(v, low), high); }

/// Sums every pixel of a tile with its tent filter at the fraction (u, v) of the tile from its left
/// and top.
Real picture_light(const WeaveOracle& o, int view, Real u, Real v, int channel) {
  const int tile_w = o.quilt.width() / o.layout.columns;
  const int tile_h = o.quilt.height() / o.layout.rows;
  const int tile_left = view % o.layout.columns * tile_w;
  const int tile_bottom =
      o.quilt.height() - view / o.layout.columns * tile_h;  // one past the last row
  const Real x = clamp_to(u * tile_w, 0.5L, tile_w - 0.5L);
  const Real y = clamp_to(v * tile_h, 0.5L, tile_h - 0.5L);
  Real light = 0;
  for (int b = std::max(0, int(y) - 2); b < std::min(tile_h, int(y) + 2); ++b)
    for (int a = std::max(0, int(x) - 2); a < std::min(tile_w, int(x) + 2); ++a)
      light += tent(x - (a + 0.5L)) * tent(y - (b + 0.5L)) *
               light_of(o.quilt.row(tile_bottom - tile_h + b)[3 * (tile_left + a) + channel]);
  return light;
}

Real share_of_view(const WeaveOracle& o, int view, Real number) {
  const int views = o.layout.view_count();
  switch (view_filter(o.options, o.rig.sheet, views)) {
    case ViewFilter::Nearest:
      return number > view && number <= view + 1 ? 1 : 0;
    case ViewFilter::Linear:
      return tent(clamp_to(number, 0.5L, views - 0.5L) - (view + 0.5L));
    case ViewFilter::Gauss: {
      const Real sigma = Real(o.rig.sheet.spot_sigma.value) * views;
      const Real d = (number - (view + 0.5L)) / sigma;
      return std::exp(-d * d / 2);
    }
  }
  return 0;
}

/// Returns the light of a subpixel whose phase is `phase`.
Real light_at_phase(const WeaveOracle& o, Point q, int channel, Real phase) {
  const auto& panel = o.rig.panel;
  const Real lens = std::floor(phase + 0.5L);
  const int views = o.layout.view_count();
  const Real number = views * (0.5L - (phase - lens));
  const Point p = lens_point(o.rig, q, lens, channel);

  const Real panel_w = Real(panel.width_px) * Real(panel.pixel_width.value);
  const Real panel_h = Real(panel.height_px) * Real(panel.pixel_height.value);
  const Real aspect = o.layout.aspect ? Real(*o.layout.aspect)
                                      : Real(o.quilt.width() / o.layout.columns) /
                                            (o.quilt.height() / o.layout.rows);
  Real w = panel_w, h = panel_h;
  const bool same = std::abs(aspect / (panel_w / panel_h) - 1) <= 0.005L;
  if (o.options.fit == PictureFit::Contain && !same) {
    w = std::min(panel_w, panel_h * aspect);
    h = std::min(panel_h, panel_w / aspect);
  } else if (o.options.fit == PictureFit::Cover && !same) {
    w = std::max(panel_w, panel_h * aspect);
    h = std::max(panel_h, panel_w / aspect);
  }
  if (w < panel_w && std::abs(p.x) > w / 2) return 0;
  if (h < panel_h && std::abs(p.y) > h / 2) return 0;

  Real light = 0, shares = 0;
  for (int view = 0; view < views; ++view) {
    const Real share = share_of_view(o, view, number);
    if (share == 0) continue;
    const int tile = o.options.order == ViewOrder::RightToLeft ? views - 1 - view : view;
    light += share * picture_light(o, tile, 0.5L + p.x / w, 0.5L - p.y / h, channel);
    shares += share;
  }
  return light / shares;
}

}  // namespace

long double WeaveOracle::phase(int i, int j, int channel) const {
  const Point q = subpixel_mm(rig, i, j, channel);
  // Seen from infinitely far, straight ahead, there is no shift.
  const Point p = std::isinf(rig.viewing.distance.value)
                      ? q
                      : seen_through(rig, q, Real(rig.viewing.centre.value));
  return lens_coordinate(rig, p, channel);
}

std::set<int> WeaveOracle::subpixel(int i, int j, int channel) const {
  // Tries both sides of any border within the stated error of the row evaluation, and both
  // roundings if they are this close; the weaver's Gauss filter is truncated.
  constexpr Real kNudge = 1e-8L;
  const Real slack = options.filter == ViewFilter::Gauss ? 0.1L : 1e-4L;
  const Point q = subpixel_mm(rig, i, j, channel);
  const Real seen = phase(i, j, channel);
  std::set<int> codes;
  for (const Real nudge : {-kNudge, kNudge}) {
    const Real code = code_of(light_at_phase(*this, q, channel, seen + nudge));
    codes.insert(int(std::lround(clamp_to(code - slack, 0, 255))));
    codes.insert(int(std::lround(clamp_to(code + slack, 0, 255))));
  }
  return codes;
}

}  // namespace lenticule::test
