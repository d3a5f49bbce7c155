// SPDX-License-Identifier: Apache-2.0
// Scene: one of each primitive that a renderer supports, on a chequered floor: spheres of mirror,
// glass and marble, a cone, a cylinder, a frustum, a box, a tetrahedron, an octahedron and a ring.
#include <array>
#include <cmath>
#include <numbers>

#include "scenes/scene_list.h"

namespace lenticule::scenes {
namespace {

void write_spheres(SceneWriter& out, int size) {
  out.fill({.colour = {0.9, 0.92, 0.95}, .diffuse = 0.15, .specular = 0.8, .shine = 100.0});
  out.sphere({0, 0, 0.8}, 0.8);
  out.fill({.colour = {0.95, 1.0, 0.97},
            .diffuse = 0.05,
            .specular = 0.12,
            .shine = 100.0,
            .transmittance = 0.85,
            .refraction_index = 1.5});
  out.sphere({2.0, 0.5, 0.5}, 0.5);
  write_ball(out, marble_picture(), {.diffuse = 0.85, .specular = 0.08, .shine = 40.0},
             {{-0.7, 1.7, 0.55}, 0.55}, 4 * size);
}

/// Writes a disc-shaped convex polygon that faces up.
void write_lid(SceneWriter& out, Vec3 centre, double radius) {
  constexpr int kCorners = 64;
  std::array<Vec3, kCorners> rim;
  for (size_t i = 0; i < kCorners; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / kCorners;
    rim[i] = centre + Vec3{radius * std::cos(angle), radius * std::sin(angle), 0};
  }
  out.polygon(rim);
}

void write_round_ones(SceneWriter& out) {
  out.fill({.colour = {0.85, 0.2, 0.15}, .diffuse = 0.8, .specular = 0.1, .shine = 30.0});
  out.cone({1.4, -1.3, 0}, 0.55, {1.4, -1.3, 1.3}, 0.0);
  out.fill({.colour = {0.2, 0.35, 0.8}, .diffuse = 0.8, .specular = 0.15, .shine = 30.0});
  out.cone({-1.9, 0.1, 0}, 0.4, {-1.9, 0.1, 1.2}, 0.4);
  write_lid(out, {-1.9, 0.1, 1.2}, 0.4);
  out.fill({.colour = {0.9, 0.7, 0.2}, .diffuse = 0.75, .specular = 0.2, .shine = 40.0});
  out.cone({-0.3, -1.9, 0}, 0.5, {-0.3, -1.9, 0.7}, 0.25);
  write_lid(out, {-0.3, -1.9, 0.7}, 0.25);
}

void write_box(SceneWriter& out) {
  PicturedMesh box{.fill = {.diffuse = 0.85, .specular = 0.05, .shine = 15.0},
                   .picture = wood_picture()};
  append_box(box, {-2.1, -1.9, 0}, {-1.2, -1.0, 0.9}, 0.9);
  out.pictured(std::move(box));
}

/// Writes the faces of a convex body around `centre`, oriented outward.
void write_faces(SceneWriter& out, Vec3 centre, std::span<const std::array<Vec3, 3>> faces) {
  for (const auto& [a, b, c] : faces) {
    const bool outward = dot(cross(b - a, c - a), a - centre) > 0.0;
    out.polygon(outward ? std::array{a, b, c} : std::array{a, c, b});
  }
}

void write_tetrahedron(SceneWriter& out) {
  out.fill({.colour = {0.25, 0.7, 0.3}, .diffuse = 0.8, .specular = 0.15, .shine = 30.0});
  const Vec3 a{0.6, 2.3, 0};
  const Vec3 b{1.6, 2.2, 0};
  const Vec3 c{1.05, 1.4, 0};
  const Vec3 top{1.08, 1.95, 0.9};
  write_faces(
      out, (a + b + c + top) / 4.0,
      std::array<std::array<Vec3, 3>, 4>{{{a, b, c}, {a, b, top}, {b, c, top}, {c, a, top}}});
}

void write_octahedron(SceneWriter& out) {
  out.fill({.colour = {0.7, 0.3, 0.7}, .diffuse = 0.6, .specular = 0.35, .shine = 50.0});
  const Vec3 centre{2.4, -0.6, 0.5};
  std::vector<std::array<Vec3, 3>> faces;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      for (const double z : {-0.5, 0.5})
        faces.push_back({centre + Vec3{x, 0, 0}, centre + Vec3{0, y, 0}, centre + Vec3{0, 0, z}});
  write_faces(out, centre, faces);
}

/// Returns a point of the torus that lies on the floor around the base of the mirror ball.
SurfacePoint torus_point(double about, double across) {
  constexpr double kRing = 1.05;
  constexpr double kTube = 0.16;
  const Vec3 out{std::cos(about), std::sin(about), 0};
  const Vec3 normal = out * std::cos(across) + Vec3{0, 0, std::sin(across)};
  return {out * kRing + Vec3{0, 0, kTube} + normal * kTube, normal};
}

void write_torus(SceneWriter& out, int size) {
  out.fill({.colour = {0.95, 0.55, 0.2}, .diffuse = 0.7, .specular = 0.25, .shine = 40.0});
  const int about = 8 * size;
  const int across = 4 * size;
  const auto point = [&](int i, int j) {
    return torus_point(turn_of(i % about, about), turn_of(j % across, across));
  };
  for (int i = 0; i < about; ++i)
    for (int j = 0; j < across; ++j) {
      const SurfacePoint a = point(i, j);
      const SurfacePoint c = point(i + 1, j + 1);
      out.patch(std::array{a, point(i + 1, j), c});
      out.patch(std::array{a, c, point(i, j + 1)});
    }
}

}  // namespace

View primitives_camera(const SceneOptions& options) {
  return turned_view({.from = {5.4, 3.6, 3.2}, .at = {0, 0, 0.6}, .angle_degrees = 42.0},
                     options.frame, kPrimitivesFrames, 0.6, 2);
}

void write_primitives(SceneWriter& out, const SceneOptions& options) {
  out.comment("one of every kind of thing");
  out.background({0.36, 0.50, 0.70});
  out.lights({{6, 2, 10}, {-3, 6, 10}, {-2, -6, 9}, {1, 0, 12}});
  write_floor(out, checker_picture(), {.diffuse = 0.9, .specular = 0.1, .shine = 20.0}, 7.0, 0.0,
              7);
  write_spheres(out, options.size);
  write_round_ones(out);
  write_box(out);
  write_tetrahedron(out);
  write_octahedron(out);
  write_torus(out, options.size);
}

}  // namespace lenticule::scenes
