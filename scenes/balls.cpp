// SPDX-License-Identifier: Apache-2.0
// The sphereflake: each sphere carries nine of a third of its radius, six round its equator and
// three above it, as spheres of one size would lie on it in the closest packing.
#include <array>
#include <cmath>
#include <numbers>

#include "scenes/nff_writer.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {
namespace {

constexpr double kShrink = 1.0 / 3.0;

struct Ball {
  Vec3 centre;
  double radius;
  Vec3 pole;      ///< unit, away from the parent
  Vec3 meridian;  ///< unit, where the equator's first child sits
};

/// The nine directions in the frame (meridian, pole x meridian, pole).
std::array<Vec3, 9> child_directions() {
  std::array<Vec3, 9> directions;
  const double degree = std::numbers::pi / 180.0;
  for (size_t i = 0; i < 6; ++i) {
    const double turn = 60.0 * degree * static_cast<double>(i);
    directions[i] = {std::cos(turn), std::sin(turn), 0};
  }
  const double rise = std::sqrt(2.0 / 3.0);  // of a tetrahedron with unit edges
  const double reach = std::sqrt(1.0 / 3.0);
  for (size_t i = 0; i < 3; ++i) {
    const double turn = (30.0 + 120.0 * static_cast<double>(i)) * degree;
    directions[6 + i] = {reach * std::cos(turn), reach * std::sin(turn), rise};
  }
  return directions;
}

void write_flake(NffWriter& out, const Ball& ball, int generations) {
  out.sphere(ball.centre, ball.radius);
  if (generations == 0) return;
  static const std::array<Vec3, 9> directions = child_directions();
  const Vec3 third = cross(ball.pole, ball.meridian);
  for (const Vec3 d : directions) {
    const Vec3 away = ball.meridian * d.x + third * d.y + ball.pole * d.z;
    const Vec3 side = normalized(cross(away, std::abs(d.z) < 0.5 ? ball.pole : third));
    write_flake(out,
                {.centre = ball.centre + away * (ball.radius * (1.0 + kShrink)),
                 .radius = ball.radius * kShrink,
                 .pole = away,
                 .meridian = side},
                generations - 1);
  }
}

}  // namespace

std::string write_balls(const SceneOptions& options) {
  NffWriter out;
  out.comment("sphereflake");
  out.view({.from = {2.1, 1.3, 1.7}, .at = {0, 0, 0}, .up = {0, 0, 1}});
  out.background({0.078, 0.361, 0.753});
  out.light({4, 3, 2});
  out.light({1, -4, 4});
  out.light({-3, 1, 5});

  out.fill({.colour = {1.0, 0.75, 0.33}, .diffuse = 0.8});
  constexpr double kFloor = 12.0;
  constexpr double kRadius = 0.5;
  out.polygon(std::array{Vec3{kFloor, kFloor, -kRadius}, Vec3{-kFloor, kFloor, -kRadius},
                         Vec3{-kFloor, -kFloor, -kRadius}, Vec3{kFloor, -kFloor, -kRadius}});

  out.fill({.colour = {1.0, 0.9, 0.7}, .diffuse = 0.5, .specular = 0.5, .shine = 45.0});
  write_flake(out, {.centre = {}, .radius = kRadius, .pole = {0, 0, 1}, .meridian = {1, 0, 0}},
              options.size);
  return out.take();
}

}  // namespace lenticule::scenes
