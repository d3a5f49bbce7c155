// SPDX-License-Identifier: Apache-2.0
#include "render/accel/wide_triangle.h"

namespace lenticule::render {
namespace {

double largest_part(Vec3 v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// Returns the distance from zero to the nearest number in [low, high].
double distance_to_range(double low, double high) {
  return std::max({low, -high, 0.0});
}

}  // namespace

double extent_of(const std::array<Vec3, 3>& corner) {
  return std::max(largest_part(corner[1] - corner[0]), largest_part(corner[2] - corner[0]));
}

Box box_of(const WideTriangle& triangle) {
  const auto& [a, b, c] = triangle.corner;
  return {{std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y}), std::min({a.z, b.z, c.z})},
          {std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y}), std::max({a.z, b.z, c.z})}};
}

bool is_wide(const std::array<Vec3, 3>& corner) {
  const double extent = extent_of(corner);
  if (!(extent > kWidest)) return false;
  const Box box = box_of(WideTriangle{.corner = corner});
  const double away =
      std::max({distance_to_range(box.low.x, box.high.x), distance_to_range(box.low.y, box.high.y),
                distance_to_range(box.low.z, box.high.z)});
  const Vec3 normal = cross(corner[1] - corner[0], corner[2] - corner[0]);
  return extent > away && dot(normal, normal) > 0.0;
}

WideTriangle make_wide_triangle(const std::array<Vec3, 3>& corner) {
  const Vec3 edge1 = corner[1] - corner[0];
  const Vec3 edge2 = corner[2] - corner[0];
  const Vec3 normal = cross(edge1, edge2);
  const double per_squared = 1.0 / dot(normal, normal);
  WideTriangle out{.corner = corner, .normal = normalized(normal)};
  out.u_axis = cross(edge2, normal) * per_squared;
  out.v_axis = cross(normal, edge1) * per_squared;
  out.slope = {length(out.u_axis), length(out.v_axis), length(out.u_axis + out.v_axis)};
  out.reach = wide_reach(extent_of(corner));
  return out;
}

}  // namespace lenticule::render
