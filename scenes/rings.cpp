// SPDX-License-Identifier: Apache-2.0
// Scene: a pyramid of knots. Each knot is six interlocked rings; each ring is a pentagon of
// cylinders with spheres at its corners.
#include <array>
#include <cmath>

#include "scenes/camera_turn.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {
namespace {

/// Returns the six axes through opposite corners of an icosahedron.
std::array<Vec3, 6> ring_axes() {
  const double golden = (1.0 + std::sqrt(5.0)) / 2.0;
  std::array<Vec3, 6> axes = {{{0, 1, golden},
                               {0, -1, golden},
                               {1, golden, 0},
                               {-1, golden, 0},
                               {golden, 0, 1},
                               {-golden, 0, 1}}};
  for (Vec3& axis : axes) axis = normalized(axis);
  return axes;
}

void write_ring(SceneWriter& out, Vec3 centre, Vec3 axis, double radius) {
  constexpr double kTube = 0.09;
  const Vec3 side = normalized(cross(axis, std::abs(axis.z) < 0.5 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}));
  const Vec3 third = cross(axis, side);
  const auto corner = [&](int k) {
    const double angle = turn_of(k % 5, 5);
    return centre + (side * std::cos(angle) + third * std::sin(angle)) * radius;
  };
  for (int k = 0; k < 5; ++k) {
    out.sphere(corner(k), kTube * radius);
    out.cone(corner(k), kTube * radius, corner(k + 1), kTube * radius);
  }
}

void write_knot(SceneWriter& out, Vec3 centre, double radius) {
  constexpr double kAside = 0.35;  // offset from the centre, so that the rings interlock
  for (const Vec3 axis : ring_axes())
    write_ring(out, centre + axis * (kAside * radius), axis, radius * 0.75);
}

/// Writes a layer; layer 0 is the knot at the top.
void write_layer(SceneWriter& out, int layer, int layers) {
  constexpr std::array<Vec3, 4> kColours = {Vec3{0.90, 0.45, 0.30}, Vec3{0.95, 0.80, 0.40},
                                            Vec3{0.45, 0.70, 0.50}, Vec3{0.40, 0.55, 0.85}};
  out.fill({.colour = kColours[static_cast<size_t>(layer) % kColours.size()],
            .diffuse = 0.6,
            .specular = 0.3,
            .shine = 40.0});
  const double height = 0.75 * (layers - 1 - layer) + 0.55;
  for (int row = 0; row <= layer; ++row)
    for (int column = 0; column <= layer; ++column)
      write_knot(out, {1.05 * (column - 0.5 * layer), 1.05 * (row - 0.5 * layer), height}, 0.5);
}

}  // namespace

View rings_camera(const SceneOptions& options) {
  const double side = options.size;
  return turned_view({.from = Vec3{1.6, 1.1, 0.9} * side + Vec3{0.8, 0.5, 0.8},
                      .at = {0, 0, 0.35 * side},
                      .angle_degrees = 28.0},
                     options.frame, kProceduralFrames);
}

void write_rings(SceneWriter& out, const SceneOptions& options) {
  const double side = options.size;
  out.comment("a pyramid of interlocked rings");
  out.background({0.078, 0.361, 0.753});
  out.light(Vec3{3, 1, 5} * side);
  out.light(Vec3{-1, 3, 5} * side);
  out.light(Vec3{1, -3, 4} * side);
  const double half = 4.0 * side;
  out.fill({.colour = {0.8, 0.78, 0.72}, .diffuse = 0.9, .specular = 0.1, .shine = 20.0});
  out.polygon(std::array{Vec3{half, half, 0}, Vec3{-half, half, 0}, Vec3{-half, -half, 0},
                         Vec3{half, -half, 0}});
  for (int layer = 0; layer < options.size; ++layer) write_layer(out, layer, options.size);
}

}  // namespace lenticule::scenes
