// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/optics_oracle.h"

#include <cmath>

namespace lenticule::test {
namespace {

using optics::Rig;

/// Returns the root of an increasing function between low and high.
template <class Function>
Real bisect(Real low, Real high, const Function& f) {
  for (int i = 0; i < 200; ++i) {
    const Real middle = low + (high - low) / 2;
    if (middle == low || middle == high) break;
    (f(middle) < 0 ? low : high) = middle;
  }
  return low + (high - low) / 2;
}

/// Returns knot (c, r) of the residual map, extrapolated linearly beyond the border.
Real knot(const optics::ResidualMap& map, int c, int r) {
  const auto inside = [&](int column, int row) {
    return static_cast<Real>(map.lenses[static_cast<size_t>(row * map.columns + column)]);
  };
  const auto along_row = [&](int row) -> Real {
    const int last = map.columns - 1;
    if (last == 0) return inside(0, row);
    if (c < 0) return inside(0, row) + c * (inside(1, row) - inside(0, row));
    if (c > last) {
      return inside(last, row) + (c - last) * (inside(last, row) - inside(last - 1, row));
    }
    return inside(c, row);
  };
  const int last = map.rows - 1;
  if (last == 0) return along_row(0);
  if (r < 0) return along_row(0) + r * (along_row(1) - along_row(0));
  if (r > last) return along_row(last) + (r - last) * (along_row(last) - along_row(last - 1));
  return along_row(r);
}

/// Returns the Catmull-Rom kernel as a function of the distance from the knot.
Real kernel(Real distance) {
  const Real d = std::fabs(distance);
  if (d < 1) return 1 - d * d * (Real(5) - 3 * d) / 2;
  if (d < 2) return (4 - d * (8 - d * (5 - d))) / 2;
  return 0;
}

Real residual(const Rig& rig, RealPoint at_px) {
  const optics::ResidualMap& map = rig.sheet.residual;
  if (map.empty()) return 0;
  const Real x = at_px.x / rig.panel.width_px * (map.columns - 1);
  const Real y = at_px.y / rig.panel.height_px * (map.rows - 1);
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  Real sum = 0;
  for (int r = row - 1; r <= row + 2; ++r) {
    for (int c = column - 1; c <= column + 2; ++c) {
      sum += kernel(x - c) * kernel(y - r) * knot(map, c, r);
    }
  }
  return sum;
}

}  // namespace

RealEye real_eye(const optics::Eye& eye) { return {eye.x, eye.y, eye.z_mm}; }

Real oracle_lens_coordinate(const Rig& rig, RealPoint at_px, int channel) {
  const Real x =
      at_px.x + static_cast<Real>(rig.sheet.channel_offset[static_cast<size_t>(channel)].value) / 3;
  const Real from_centre =
      (x - static_cast<Real>(rig.panel.width_px) / 2) +
      static_cast<Real>(rig.sheet.slant) * (at_px.y - static_cast<Real>(rig.panel.height_px) / 2);
  return 3 * from_centre / static_cast<Real>(rig.sheet.pitch.value) +
         static_cast<Real>(rig.sheet.offset.value) + residual(rig, {x, at_px.y});
}

RealPoint oracle_shift(const Rig& rig, RealPoint lens_point, const RealEye& eye) {
  const Real g = rig.sheet.gap.value, nu = rig.sheet.refraction_shape;
  if (std::isinf(eye.z)) {
    const Real scale = g / std::sqrt(1 + (1 - nu) * (eye.x * eye.x + eye.y * eye.y));
    return {eye.x * scale, eye.y * scale};
  }
  const Real rx = eye.x - lens_point.x, ry = eye.y - lens_point.y;
  const Real scale = g / std::sqrt(eye.z * eye.z + (1 - nu) * (rx * rx + ry * ry));
  return {rx * scale, ry * scale};
}

RealPoint oracle_lens_point(const Rig& rig, RealPoint q, const RealEye& eye) {
  if (std::isinf(eye.z)) {
    const RealPoint shift = oracle_shift(rig, q, eye);
    return {q.x + shift.x, q.y + shift.y};
  }
  // L lies between Q and the point in front of the eye: L = Q + part * (E - Q).
  const Real dx = eye.x - q.x, dy = eye.y - q.y;
  const Real length = std::sqrt(dx * dx + dy * dy);
  if (length == 0) return q;
  const Real part = bisect(0, 1, [&](Real p) {
    const RealPoint shift = oracle_shift(rig, {q.x + p * dx, q.y + p * dy}, eye);
    return p * length - std::sqrt(shift.x * shift.x + shift.y * shift.y);
  });
  return {q.x + part * dx, q.y + part * dy};
}

Real oracle_phase(const Rig& rig, RealPoint at_px, int channel, const RealEye& eye) {
  const Real ax = rig.panel.pixel_width.value, ay = rig.panel.pixel_height.value;
  const Real w = rig.panel.width_px, h = rig.panel.height_px;
  const RealPoint q{ax * (at_px.x - w / 2), ay * (h / 2 - at_px.y)};
  const RealPoint l = oracle_lens_point(rig, q, eye);
  return oracle_lens_coordinate(rig, {l.x / ax + w / 2, h / 2 - l.y / ay}, channel);
}

RealRay oracle_ray(const Rig& rig, int i, int j, int channel) {
  const optics::SubpixelOffset& offset = rig.panel.layout.offset(i, j, channel);
  const RealPoint at_px{static_cast<Real>(i) + static_cast<Real>(offset.x_px),
                        static_cast<Real>(j) + static_cast<Real>(offset.y_px)};
  const Real z = rig.viewing.distance.value, g = rig.sheet.gap.value;
  RealEye eye{0, 0, z};
  if (!std::isinf(z)) eye = {rig.viewing.centre.value, rig.viewing.height.value, z};
  const Real seen_from_centre = oracle_phase(rig, at_px, channel, eye);
  const Real lens = std::floor(seen_from_centre + Real(0.5));

  // Phase grows with the eye's x: the range is widened until it contains the lens.
  const auto missing = [&](Real x) {
    return oracle_phase(rig, at_px, channel, {x, eye.y, eye.z}) - lens;
  };
  Real reach = std::isinf(z) ? Real(0.01) : z / 100;
  while (missing(-reach) > 0 || missing(reach) < 0) reach *= 2;
  eye.x = bisect(-reach, reach, missing);

  const RealPoint q{
      rig.panel.pixel_width.value * (at_px.x - static_cast<Real>(rig.panel.width_px) / 2),
      rig.panel.pixel_height.value * (static_cast<Real>(rig.panel.height_px) / 2 - at_px.y)};
  RealPoint l = oracle_lens_point(rig, q, eye);
  if (std::isinf(z))
    return {{l.x, q.y}, eye.x, 0, static_cast<long>(lens), seen_from_centre - lens};
  l.y = (q.y * z + g * eye.y) / (z + g);  // the vertical shift is the paraxial one by definition
  return {l, (eye.x - l.x) / z, (eye.y - l.y) / z, static_cast<long>(lens),
          seen_from_centre - lens};
}

}  // namespace lenticule::test
