// SPDX-License-Identifier: Apache-2.0
// Demo scene for lens sheets: a teapot turns on a table in the panel's plane, a red ball lies in
// front of the panel, and a blue column stands behind it. Floor and wall are chequered to make
// their depth visible. y is up, z points to the viewer.
#include <cmath>
#include <numbers>

#include "scenes/scene_list.h"
#include "scenes/scene_writer.h"
#include "scenes/teapot_mesh.h"

namespace lenticule::scenes {
namespace {

constexpr double kTableHeight = 0.35;
constexpr double kTableRadius = 1.9;
constexpr double kTeapotScale = 0.85;
constexpr double kWall = -3.4;  // z
constexpr double kFront = 4.6;  // z of the floor's front edge, below the picture
constexpr double kSide = 9.0;   // |x|, beyond the picture
constexpr double kTop = 7.0;    // top of the wall

void write_surroundings(SceneWriter& out) {
  const Fill light_tile{.colour = {0.86, 0.84, 0.78}, .diffuse = 0.8, .specular = 0.08};
  const Fill dark_tile{.colour = {0.33, 0.38, 0.42}, .diffuse = 0.8, .specular = 0.08};
  write_checker_board(out, {.corner = {-kSide, 0, kFront},
                            .along = {2 * kSide, 0, 0},
                            .across = {0, 0, kWall - kFront},
                            .columns = 18,
                            .rows = 8,
                            .even = light_tile,
                            .odd = dark_tile});
  write_checker_board(out, {.corner = {-kSide, 0, kWall},
                            .along = {2 * kSide, 0, 0},
                            .across = {0, kTop, 0},
                            .columns = 18,
                            .rows = 7,
                            .even = {.colour = {0.62, 0.74, 0.80}, .diffuse = 0.8},
                            .odd = {.colour = {0.50, 0.63, 0.70}, .diffuse = 0.8}});
}

void write_table(SceneWriter& out) {
  constexpr int kCorners = 96;
  out.fill({.colour = {0.42, 0.27, 0.18}, .diffuse = 0.8, .specular = 0.15, .shine = 20.0});
  out.cone({0, 0, 0}, kTableRadius, {0, kTableHeight, 0}, kTableRadius);
  std::array<Vec3, kCorners> rim;
  for (size_t i = 0; i < kCorners; ++i) {
    const double angle = -2.0 * std::numbers::pi * static_cast<double>(i) / kCorners;
    rim[i] = {kTableRadius * std::cos(angle), kTableHeight, kTableRadius * std::sin(angle)};
  }
  out.polygon(rim);
}

void write_teapot_on_table(SceneWriter& out, const SceneOptions& options) {
  const double angle = 2.0 * std::numbers::pi * options.frame / kDemoFrames;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  // Converts z up to y up and rotates about the vertical.
  const auto direction = [=](Vec3 p) { return Vec3{c * p.x - s * p.y, p.z, -(s * p.x + c * p.y)}; };
  out.fill({.colour = {1.0, 0.62, 0.15}, .diffuse = 0.75, .specular = 0.25, .shine = 40.0});
  for (SurfaceTriangle triangle : teapot_triangles(options.size)) {
    for (auto& [position, normal] : triangle) {
      position = direction(position) * kTeapotScale + Vec3{0, kTableHeight, 0};
      normal = direction(normal);
    }
    out.patch(triangle);
  }
}

}  // namespace

/// Returns a camera that looks slightly down on the teapot's centre and sees 4.6 units there.
View demo_camera(const SceneOptions& /*options*/) {
  constexpr double kDistance = 14.0;
  constexpr double kSeen = 4.6;
  constexpr double kElevation = 12.0 * std::numbers::pi / 180.0;
  const Vec3 at{0, 1.5, 0};
  const Vec3 back{0, std::sin(kElevation), std::cos(kElevation)};
  const double angle = 2.0 * std::atan(kSeen / 2.0 / kDistance) * 180.0 / std::numbers::pi;
  return {.from = at + back * kDistance, .at = at, .up = {0, 1, 0}, .angle_degrees = angle};
}

void write_demo(SceneWriter& out, const SceneOptions& options) {
  out.comment("a teapot turning in the glass, a ball before it, a column behind it");
  out.background({0.10, 0.12, 0.16});
  out.light({-6, 10, 9}, {2.1, 2.0, 1.9});
  out.light({7, 8, 10}, {1.3, 1.4, 1.5});
  write_surroundings(out);
  write_table(out);
  write_teapot_on_table(out, options);

  out.fill({.colour = {0.85, 0.08, 0.06}, .diffuse = 0.8, .specular = 0.25, .shine = 60.0});
  out.sphere({-2.9, 0.62, 2.5}, 0.62);

  out.fill({.colour = {0.12, 0.25, 0.75}, .diffuse = 0.85, .specular = 0.1, .shine = 20.0});
  out.cone({3.35, 0, -2.4}, 0.45, {3.35, 2.0, -2.4}, 0.35);
  out.fill({.colour = {0.25, 0.65, 0.2}, .diffuse = 0.8, .specular = 0.2, .shine = 40.0});
  out.sphere({3.35, 2.4, -2.4}, 0.46);
}

}  // namespace lenticule::scenes
