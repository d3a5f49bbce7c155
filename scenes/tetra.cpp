// SPDX-License-Identifier: Apache-2.0
// Scene: a tetrahedron of tetrahedra; each consists of four of half its size at its corners.
#include <array>
#include <cmath>

#include "scenes/camera_turn.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {
namespace {

using Corners = std::array<Vec3, 4>;

/// Writes the faces. Corners 0, 1, 2 are counter-clockwise seen from outside; corner 3 is opposite.
void write_faces(SceneWriter& out, const Corners& p) {
  out.polygon(std::array{p[0], p[1], p[2]});
  out.polygon(std::array{p[0], p[3], p[1]});
  out.polygon(std::array{p[1], p[3], p[2]});
  out.polygon(std::array{p[2], p[3], p[0]});
}

void write_pyramid(SceneWriter& out, const Corners& corners, int generations) {
  if (generations == 1) return write_faces(out, corners);
  for (const Vec3 corner : corners) {
    Corners quarter = corners;
    for (Vec3& p : quarter) p = (p + corner) / 2.0;
    write_pyramid(out, quarter, generations - 1);
  }
}

}  // namespace

View tetra_camera(const SceneOptions& options) {
  return turned_view({.from = {1.6, 3.0, 1.9}, .at = {0, 0, 0.55}, .angle_degrees = 32.0},
                     options.frame, kProceduralFrames);
}

void write_tetra(SceneWriter& out, const SceneOptions& options) {
  out.comment("a tetrahedron of tetrahedra");
  out.background({0.078, 0.361, 0.753});
  out.light({2, 5, 4});
  out.light({4, -3, 5});
  out.light({-4, 2, 5});
  out.light({0, 2, 8});
  out.fill({.colour = {1.0, 0.35, 0.16}, .diffuse = 1.0, .specular = 0.15, .shine = 20.0});
  const double edge = std::sqrt(3.0) / 2.0;
  write_pyramid(
      out, {Vec3{-0.5, edge, 0}, Vec3{1, 0, 0}, Vec3{-0.5, -edge, 0}, Vec3{0, 0, std::sqrt(2.0)}},
      options.size);
}

}  // namespace lenticule::scenes
