// SPDX-License-Identifier: Apache-2.0
// Scene: the sphereflake over a plain floor.
#include <array>

#include "scenes/scene_functions.h"
#include "scenes/sphereflake.h"

namespace lenticule::scenes {

View balls_camera(const SceneOptions& /*options*/) {
  return {.from = {2.1, 1.3, 1.7}, .at = {0, 0, 0}, .up = {0, 0, 1}};
}

void write_balls(SceneWriter& out, const SceneOptions& options) {
  out.comment("sphereflake");
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
  write_sphereflake(out,
                    {.centre = {}, .radius = kRadius, .pole = {0, 0, 1}, .meridian = {1, 0, 0}},
                    options.size);
}

}  // namespace lenticule::scenes
