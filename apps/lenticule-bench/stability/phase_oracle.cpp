// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/stability/phase_oracle.h"

#include <cmath>

namespace lenticule::bench {
namespace {

struct Point {
  Real x = 0;
  Real y = 0;
};

/// Returns the panel point in millimetres, x right, y up, from the panel's centre.
Point panel_point(const optics::Rig& rig, int i, int j, int channel) {
  const optics::SubpixelOffset& in_pixel = rig.panel.layout.offset(i, j, channel);
  const Real x_px = Real(i) + Real(in_pixel.x_px) - Real(rig.panel.width_px) / 2;
  const Real y_px = Real(rig.panel.height_px) / 2 - (Real(j) + Real(in_pixel.y_px));
  return {Real(rig.panel.pixel_width.value) * x_px, Real(rig.panel.pixel_height.value) * y_px};
}

/// Returns Delta(L, E) = g r / sqrt(Ez^2 + (1 - nu) |r|^2), r = E - L.
Point shift(const optics::Rig& rig, Point lens_point, const OracleEye& eye) {
  const Real gap = rig.sheet.gap.value;
  const Real kappa = 1 - Real(rig.sheet.refraction_shape);
  if (std::isinf(eye.z)) {
    const Real way = std::sqrt(1 + kappa * (eye.x * eye.x + eye.y * eye.y));
    return {gap * eye.x / way, gap * eye.y / way};
  }
  const Point r{eye.x - lens_point.x, eye.y - lens_point.y};
  const Real way = std::sqrt(eye.z * eye.z + kappa * (r.x * r.x + r.y * r.y));
  return {gap * r.x / way, gap * r.y / way};
}

/// Returns the lens point through which the eye sees the panel point: L = Q + Delta(L, E). Delta
/// points from the panel point toward the eye's projection; its length grows with the remaining
/// distance.
Point lens_point(const optics::Rig& rig, Point q, const OracleEye& eye) {
  if (std::isinf(eye.z)) {
    const Point delta = shift(rig, q, eye);
    return {q.x + delta.x, q.y + delta.y};
  }
  // Distant eyes: iterate L until it no longer changes.
  Point l = q;
  for (int round = 0; round < 40; ++round) {
    const Point delta = shift(rig, l, eye);
    const Point next{q.x + delta.x, q.y + delta.y};
    const Real moved = std::fabs(next.x - l.x) + std::fabs(next.y - l.y);
    l = next;
    if (moved <= 1e-18L * (std::fabs(l.x) + std::fabs(l.y))) return l;
  }
  // Otherwise bisect: L = Q + part (E - Q).
  const Point way{eye.x - q.x, eye.y - q.y};
  const Real length = std::sqrt(way.x * way.x + way.y * way.y);
  Real low = 0, high = 1;
  for (int step = 0; step < 80; ++step) {
    const Real part = low + (high - low) / 2;
    const Point delta = shift(rig, {q.x + part * way.x, q.y + part * way.y}, eye);
    const bool beyond = part * length > std::sqrt(delta.x * delta.x + delta.y * delta.y);
    (beyond ? high : low) = part;
  }
  return {q.x + low * way.x, q.y + low * way.y};
}

}  // namespace

OraclePlace oracle_place(Real phase) {
  // A phase less than 2^-32 below a border counts as on the border.
  const Real tolerance = 1 / Real(4294967296.0);
  const Real lens = std::floor(phase + Real(0.5) + tolerance);
  return {static_cast<int64_t>(lens), phase - lens};
}

Real oracle_lens_at(const optics::Rig& rig, Real x_mm, Real y_mm, int channel) {
  const Real offset = rig.sheet.channel_offset[static_cast<size_t>(channel)].value;
  const Real x_px = x_mm / Real(rig.panel.pixel_width.value) + offset / 3;
  const Real down_px = -y_mm / Real(rig.panel.pixel_height.value);
  return 3 * (x_px + Real(rig.sheet.slant) * down_px) / Real(rig.sheet.pitch.value) +
         Real(rig.sheet.offset.value);
}

Real oracle_phase(const optics::Rig& rig, int i, int j, int channel, const OracleEye& eye) {
  const Point l = lens_point(rig, panel_point(rig, i, j, channel), eye);
  return oracle_lens_at(rig, l.x, l.y, channel);
}

OracleEye oracle_design_eye(const optics::Rig& rig) {
  const Real z = rig.viewing.distance.value;
  if (std::isinf(z)) return {0, 0, z};
  return {Real(rig.viewing.centre.value), Real(rig.viewing.height.value), z};
}

OracleRay oracle_ray(const optics::Rig& rig, int i, int j, int channel, int64_t lens) {
  OracleEye eye = oracle_design_eye(rig);
  const auto beyond = [&](Real x) {
    return oracle_phase(rig, i, j, channel, {x, eye.y, eye.z}) >= static_cast<Real>(lens);
  };
  // The phase grows with the eye's x: widen the interval until it contains the lens, then bisect.
  Real low = std::isinf(eye.z) ? Real(-0.01) : -eye.z / 100;
  Real high = -low;
  while (beyond(low)) low *= 2;
  while (!beyond(high)) high *= 2;
  for (int step = 0; step < 64; ++step) {
    const Real middle = low + (high - low) / 2;
    (beyond(middle) ? high : low) = middle;
  }
  eye.x = high;
  const Point l = lens_point(rig, panel_point(rig, i, j, channel), eye);
  return {l.x, std::isinf(eye.z) ? eye.x : (eye.x - l.x) / eye.z};
}

}  // namespace lenticule::bench
