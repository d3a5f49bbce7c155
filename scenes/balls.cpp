// SPDX-License-Identifier: Apache-2.0
// The sphereflake, and the two scenes that show it.
#include <array>
#include <cmath>
#include <numbers>

#include "scenes/scene_list.h"
#include "scenes/scene_writer.h"

namespace lenticule::scenes {
namespace {

struct Ball {
  Vec3 centre;
  double radius;
  Vec3 pole;      ///< unit, away from the parent
  Vec3 meridian;  ///< unit, toward the first child on the equator
};

constexpr double kRadius = 0.5;
constexpr double kShrink = 1.0 / 3.0;
constexpr Ball kFirst{.centre = {}, .radius = kRadius, .pole = {0, 0, 1}, .meridian = {1, 0, 0}};

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

/// Writes (9^(generations + 1) - 1) / 8 spheres that touch but do not intersect: each carries nine
/// of a third of its radius, six around the equator and three above it, in the positions of equal
/// spheres in the closest packing.
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

}  // namespace

// Scene: the sphereflake over a plain floor.

View balls_camera(const SceneOptions& /*options*/) {
  return {.from = {2.1, 1.3, 1.7}, .at = {0, 0, 0}, .up = {0, 0, 1}};
}

void write_balls(SceneWriter& out, const SceneOptions& options) {
  out.comment("sphereflake");
  out.background({0.078, 0.361, 0.753});
  out.lights({{4, 3, 2}, {1, -4, 4}, {-3, 1, 5}});
  out.fill({.colour = {1.0, 0.75, 0.33}, .diffuse = 0.8});
  out.square(12.0, -kRadius);
  out.fill({.colour = {1.0, 0.9, 0.7}, .diffuse = 0.5, .specular = 0.5, .shine = 45.0});
  write_sphereflake(out, kFirst, options.size);
}

// Scene: a small sphereflake of mirrors over a chequered floor, with a glass ball in front and a
// marble ball behind.

namespace {

void write_companions(SceneWriter& out) {
  write_ball(out, marble_picture(), {.diffuse = 0.8, .specular = 0.1, .shine = 40.0},
             {{-1.0, -0.75, -0.2}, 0.3}, 24);
  out.fill({.colour = {0.9, 1.0, 0.95},
            .diffuse = 0.1,
            .specular = 0.15,
            .shine = 80.0,
            .transmittance = 0.75,
            .refraction_index = 1.5});
  out.sphere({0.85, -0.6, -0.25}, 0.25);
}

}  // namespace

View small_balls_camera(const SceneOptions& options) {
  return turned_view({.from = {2.0, 1.5, 1.2}, .at = {0, 0, -0.05}, .angle_degrees = 42.0},
                     options.frame, kSmallBallsFrames, 0.3, 2);
}

void write_small_balls(SceneWriter& out, const SceneOptions& options) {
  out.comment("a small sphereflake over a chequered floor");
  out.background({0.30, 0.42, 0.62});
  out.lights({{4, 3, 8}, {1, -4, 7}, {-4, 1, 8}, {0, 0, 9}});
  write_floor(out, checker_picture(), {.diffuse = 0.9, .specular = 0.15, .shine = 20.0}, 6.0,
              -kRadius, 12);
  write_companions(out);
  out.fill({.colour = {1.0, 0.85, 0.6}, .diffuse = 0.6, .specular = 0.4, .shine = 45.0});
  write_sphereflake(out, kFirst, options.size);
}

}  // namespace lenticule::scenes
