// SPDX-License-Identifier: Apache-2.0
// Six children lie around the equator and three above it, in the positions of equal spheres in the
// closest packing.
#include "scenes/sphereflake.h"

#include <array>
#include <cmath>
#include <numbers>

namespace lenticule::scenes {
namespace {

constexpr double kShrink = 1.0 / 3.0;

/// Returns the nine directions in the frame (meridian, pole x meridian, pole).
std::array<Vec3, 9> child_directions() {
  std::array<Vec3, 9> directions;
  const double degree = std::numbers::pi / 180.0;
  for (size_t i = 0; i < 6; ++i) {
    const double turn = 60.0 * degree * static_cast<double>(i);
    directions[i] = {std::cos(turn), std::sin(turn), 0};
  }
  const double rise = std::sqrt(2.0 / 3.0);  // height of a tetrahedron with unit edges
  const double reach = std::sqrt(1.0 / 3.0);
  for (size_t i = 0; i < 3; ++i) {
    const double turn = (30.0 + 120.0 * static_cast<double>(i)) * degree;
    directions[6 + i] = {reach * std::cos(turn), reach * std::sin(turn), rise};
  }
  return directions;
}

}  // namespace

void write_sphereflake(SceneWriter& out, const Ball& ball, int generations) {
  out.sphere(ball.centre, ball.radius);
  if (generations == 0) return;
  static const std::array<Vec3, 9> directions = child_directions();
  const Vec3 third = cross(ball.pole, ball.meridian);
  for (const Vec3 d : directions) {
    const Vec3 away = ball.meridian * d.x + third * d.y + ball.pole * d.z;
    const Vec3 side = normalized(cross(away, std::abs(d.z) < 0.5 ? ball.pole : third));
    write_sphereflake(out,
                      {.centre = ball.centre + away * (ball.radius * (1.0 + kShrink)),
                       .radius = ball.radius * kShrink,
                       .pole = away,
                       .meridian = side},
                      generations - 1);
  }
}

}  // namespace lenticule::scenes
