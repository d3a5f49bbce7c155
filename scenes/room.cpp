// SPDX-License-Identifier: Apache-2.0
// Scene: a furnished room with floor boards, bricks, a rug, a painting, a mirror that reflects the
// room, and a table with a teapot and balls of glass, mirror and marble. The camera circles the
// table inside the room.
#include <array>
#include <cmath>

#include "scenes/scene_list.h"
#include "scenes/teapot_mesh.h"

namespace lenticule::scenes {
namespace {

constexpr double kHalfX = 4.0;
constexpr double kHalfY = 3.0;
constexpr double kCeiling = 3.0;
constexpr double kTableTop = 0.8;
constexpr double kProud = 0.01;  ///< distance of flat objects from the surface behind them

Fill matt(Vec3 colour = {1, 1, 1}) { return {.colour = colour, .diffuse = 1.0, .specular = 0.0}; }

void write_quad(SceneWriter& out, Vec3 corner, Vec3 along, Vec3 across) {
  out.polygon(std::array{corner, corner + across, corner + along + across, corner + along});
}

void write_shell(SceneWriter& out) {
  write_board(out, wood_picture(), {.diffuse = 1.0, .specular = 0.12, .shine = 30.0},
              {.corner = {-kHalfX, kHalfY, 0},
               .along = {2 * kHalfX, 0, 0},
               .across = {0, -2 * kHalfY, 0},
               .columns = 3,
               .rows = 3});
  write_board(out, brick_picture(), matt(),
              {.corner = {-kHalfX, -kHalfY, kCeiling},
               .along = {0, 2 * kHalfY, 0},
               .across = {0, 0, -kCeiling},
               .columns = 6,
               .rows = 4});
  out.fill(matt({0.86, 0.84, 0.76}));
  write_quad(out, {-kHalfX, kHalfY, kCeiling}, {2 * kHalfX, 0, 0}, {0, 0, -kCeiling});
  write_quad(out, {kHalfX, -kHalfY, kCeiling}, {-2 * kHalfX, 0, 0}, {0, 0, -kCeiling});
  out.fill(matt({0.55, 0.68, 0.72}));
  write_quad(out, {kHalfX, kHalfY, kCeiling}, {0, -2 * kHalfY, 0}, {0, 0, -kCeiling});
  out.fill(matt({0.92, 0.92, 0.90}));
  write_quad(out, {-kHalfX, -kHalfY, kCeiling}, {2 * kHalfX, 0, 0}, {0, 2 * kHalfY, 0});
}

/// Writes the mirror on the wall y = 3, with its wooden frame.
void write_mirror(SceneWriter& out) {
  PicturedMesh frame{.fill = matt(), .picture = wood_picture()};
  append_box(frame, {-1.5, kHalfY - 0.05, 0.25}, {1.5, kHalfY - kProud, 1.95}, 1.0);
  out.pictured(std::move(frame));
  out.fill({.colour = {0.9, 0.95, 1.0}, .diffuse = 0.06, .specular = 0.88, .shine = 200.0});
  write_quad(out, {-1.38, kHalfY - 0.05 - kProud, 1.83}, {2.76, 0, 0}, {0, 0, -1.46});
}

/// Writes the painting on the wall x = 4.
void write_painting(SceneWriter& out) {
  out.fill({.colour = {0.72, 0.56, 0.22}, .diffuse = 0.7, .specular = 0.2, .shine = 30.0});
  write_quad(out, {kHalfX - kProud, 1.3, 2.0}, {0, -2.6, 0}, {0, 0, -1.5});
  write_board(
      out, painting_picture(), matt(),
      {.corner = {kHalfX - 2 * kProud, 1.2, 1.9}, .along = {0, -2.4, 0}, .across = {0, 0, -1.3}});
}

void write_rug(SceneWriter& out) {
  write_board(out, weave_picture(), matt(),
              {.corner = {-1.8, 1.4, kProud},
               .along = {3.6, 0, 0},
               .across = {0, -2.8, 0},
               .columns = 3,
               .rows = 2.25});
}

void write_table(SceneWriter& out) {
  PicturedMesh table{.fill = {.diffuse = 1.1, .specular = 0.12, .shine = 40.0},
                     .picture = wood_picture()};
  append_box(table, {-1.1, -0.7, kTableTop - 0.07}, {1.1, 0.7, kTableTop}, 0.9);
  for (const double x : {-0.95, 0.95})
    for (const double y : {-0.55, 0.55})
      append_box(table, {x - 0.05, y - 0.05, 0}, {x + 0.05, y + 0.05, kTableTop - 0.07}, 0.9);
  out.pictured(std::move(table));
}

void write_teapot_on_table(SceneWriter& out, int size) {
  constexpr double kScale = 0.13;
  const Vec3 place{0, 0, kTableTop};
  out.fill({.colour = {0.35, 0.55, 0.75}, .diffuse = 0.7, .specular = 0.25, .shine = 60.0});
  for (SurfaceTriangle triangle : teapot_triangles(size)) {
    for (auto& [position, normal] : triangle) position = position * kScale + place;
    out.patch(triangle);
  }
}

void write_balls_on_table(SceneWriter& out, int size) {
  write_ball(out, marble_picture(), {.diffuse = 0.8, .specular = 0.1, .shine = 60.0},
             {{-0.72, 0.3, kTableTop + 0.17}, 0.17}, 4 * size);
  out.fill({.colour = {0.95, 1.0, 0.98},
            .diffuse = 0.05,
            .specular = 0.1,
            .shine = 120.0,
            .transmittance = 0.85,
            .refraction_index = 1.5});
  out.sphere({0.62, -0.42, kTableTop + 0.16}, 0.16);
  out.fill({.colour = {0.9, 0.8, 0.5}, .diffuse = 0.15, .specular = 0.75, .shine = 120.0});
  out.sphere({0.75, 0.35, kTableTop + 0.14}, 0.14);
  out.fill({.colour = {0.8, 0.15, 0.12}, .diffuse = 0.8, .specular = 0.1, .shine = 40.0});
  out.sphere({-0.6, -0.42, kTableTop + 0.12}, 0.12);
}

/// Writes a lamp over the table and a column in each corner.
void write_cones(SceneWriter& out) {
  out.fill({.colour = {0.2, 0.5, 0.35}, .diffuse = 0.8, .specular = 0.1, .shine = 30.0});
  out.cone({0, 0, 2.0}, 0.34, {0, 0, 2.3}, 0.08);
  out.cone({0, 0, 2.3}, 0.012, {0, 0, kCeiling}, 0.012);
  out.fill(matt({0.88, 0.86, 0.82}));
  for (const double x : {-kHalfX + 0.3, kHalfX - 0.3})
    for (const double y : {-kHalfY + 0.3, kHalfY - 0.3}) {
      out.cone({x, y, 0}, 0.22, {x, y, 0.15}, 0.17);
      out.cone({x, y, 0.15}, 0.17, {x, y, kCeiling}, 0.14);
    }
}

}  // namespace

View room_camera(const SceneOptions& options) {
  const double angle = turn_of(options.frame, kRoomFrames);
  return {.from = {-2.4 * std::cos(angle), -1.8 * std::sin(angle), 1.5 + 0.2 * std::sin(2 * angle)},
          .at = {0, 0, kTableTop + 0.12},
          .angle_degrees = 50.0};
}

void write_room(SceneWriter& out, const SceneOptions& options) {
  out.comment("a room with a table, a mirror and a painting");
  out.background({0.1, 0.1, 0.12});
  out.light({0, 0, 1.95});            // inside the lamp
  for (const double x : {-3.0, 3.0})  // far enough aside to reach under the table
    for (const double y : {-2.2, 2.2}) out.light({x, y, 2.5});
  write_shell(out);
  write_mirror(out);
  write_painting(out);
  write_rug(out);
  write_table(out);
  write_teapot_on_table(out, options.size);
  write_balls_on_table(out, options.size);
  write_cones(out);
}

}  // namespace lenticule::scenes
