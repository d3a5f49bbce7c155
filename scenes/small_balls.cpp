// SPDX-License-Identifier: Apache-2.0
// Scene: a small sphereflake of mirrors over a chequered floor, with a glass ball in front and a
// marble ball behind.
#include "scenes/camera_turn.h"
#include "scenes/scene_functions.h"
#include "scenes/sphereflake.h"

namespace lenticule::scenes {
namespace {

constexpr double kRadius = 0.5;

void write_floor(SceneWriter& out) {
  constexpr double kHalf = 6.0;
  PicturedMesh floor{.fill = {.diffuse = 0.9, .specular = 0.15, .shine = 20.0},
                     .picture = checker_picture()};
  append_board(floor, {.corner = {-kHalf, kHalf, -kRadius},
                       .along = {2 * kHalf, 0, 0},
                       .across = {0, -2 * kHalf, 0},
                       .columns = 12,
                       .rows = 12});
  out.pictured(std::move(floor));
}

void write_companions(SceneWriter& out) {
  PicturedMesh marble{.fill = {.diffuse = 0.8, .specular = 0.1, .shine = 40.0},
                      .picture = marble_picture()};
  append_ball(marble, {-1.0, -0.75, -0.2}, 0.3, 24);
  out.pictured(std::move(marble));
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
  out.light({4, 3, 8});
  out.light({1, -4, 7});
  out.light({-4, 1, 8});
  out.light({0, 0, 9});
  write_floor(out);
  write_companions(out);
  out.fill({.colour = {1.0, 0.85, 0.6}, .diffuse = 0.6, .specular = 0.4, .shine = 45.0});
  write_sphereflake(out,
                    {.centre = {}, .radius = kRadius, .pole = {0, 0, 1}, .meridian = {1, 0, 0}},
                    options.size);
}

}  // namespace lenticule::scenes
