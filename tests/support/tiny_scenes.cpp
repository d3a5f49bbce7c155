// SPDX-License-Identifier: Apache-2.0
#include "tests/support/tiny_scenes.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace lenticule::test {
namespace {

using render::Cone;
using render::Light;
using render::Material;
using render::SceneDescription;
using render::Sphere;
using render::Texture;
using render::TriangleMesh;

// Odd numbers on purpose: no object is aligned with the lattice of subpixels.
constexpr Vec3 kLightLeft{-7.13, 8.29, 9.41};
constexpr Vec3 kLightRight{6.37, 5.71, 7.93};

Material matte(Vec3 colour) { return Material{.name = "matte", .colour = colour}; }

Material plastic(Vec3 colour) {
  return Material{
      .name = "plastic", .colour = colour, .diffuse = 0.7, .specular = 0.25, .shine = 23.0};
}

Material glass(double index) {
  return Material{.name = "glass",
                  .colour = {0.93, 0.97, 0.95},
                  .diffuse = 0.05,
                  .specular = 0.12,
                  .shine = 40.0,
                  .transmittance = 0.85,
                  .refraction_index = index};
}

Light point_light(Vec3 position, double intensity) {
  Light light;
  light.position = position;
  light.colour = {intensity, intensity * 0.9, intensity * 0.8};
  return light;
}

std::shared_ptr<const Texture> checker_texture() {
  auto texture = std::make_shared<Texture>();
  texture->name = "checker";
  texture->width = 5;
  texture->height = 3;
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 5; ++x)
      for (const float v : {0.1F + 0.15F * static_cast<float>(x), (x + y) % 2 ? 0.9F : 0.2F,
                            0.2F + 0.3F * static_cast<float>(y), 1.0F})
        texture->rgba.push_back(v);
  return texture;
}

SceneDescription named(const char* source) {
  SceneDescription scene;
  scene.source = source;
  scene.background = {0.11, 0.23, 0.37};
  return scene;
}

/// Spheres on a floor, in code values, as in NFF files.
NamedScene spheres_and_shadows() {
  SceneDescription scene = named("spheres");
  scene.colour_managed = false;
  scene.materials = {matte({0.8, 0.7, 0.55}), plastic({0.9, 0.25, 0.2}), plastic({0.2, 0.5, 0.9})};
  scene.spheres = {{.centre = {-1.31, -0.23, 0.62}, .radius = 1.07, .material = 1},
                   {.centre = {1.17, 0.19, -0.77}, .radius = 1.43, .material = 2},
                   {.centre = {0.41, -0.87, 1.53}, .radius = 0.51, .material = 1}};
  scene.meshes = {rectangle_mesh({-5.03, -1.41, 5.07}, {10.11, 0.07, 0.0}, {0.0, 0.05, -10.3}, 0)};
  scene.lights = {point_light(kLightLeft, 0.45), point_light(kLightRight, 0.4)};
  return {"spheres", scene};
}

NamedScene cones_and_cylinders() {
  SceneDescription scene = named("cones");
  scene.colour_managed = false;
  scene.materials = {matte({0.7, 0.8, 0.6}), plastic({0.85, 0.6, 0.2}), matte({0.3, 0.4, 0.8})};
  Cone tilted;
  tilted.base = {-1.83, -1.27, 0.31};
  tilted.base_radius = 0.93;
  tilted.apex = {-0.91, 1.37, 0.83};
  tilted.apex_radius = 0.21;
  tilted.material = 1;
  Cone tube;  // open, with its inside partly visible
  tube.base = {1.37, -0.93, -1.13};
  tube.base_radius = 0.81;
  tube.apex = {1.71, 0.57, 0.97};
  tube.apex_radius = 0.81;
  tube.inward = true;
  tube.material = 2;
  Cone pointed = tilted;
  pointed.base = {0.13, -1.31, 1.57};
  pointed.base_radius = 0.47;
  pointed.apex = {0.23, 0.41, 1.43};
  pointed.apex_radius = 0.0;
  pointed.material = 2;
  scene.cones = {tilted, tube, pointed};
  scene.meshes = {rectangle_mesh({-4.07, -2.03, -2.21}, {8.21, 0.0, 0.11}, {0.03, 4.17, 0.0}, 0)};
  scene.lights = {point_light(kLightLeft, 0.5), point_light(kLightRight, 0.35)};
  return {"cones", scene};
}

/// Returns meshes in linear light: smooth normals, a texture, a sun, a spot, emission.
NamedScene meshes_and_lights() {
  SceneDescription scene = named("meshes");
  scene.materials = {matte({0.9, 0.9, 0.85}), plastic({0.6, 0.2, 0.7}), matte({1, 1, 1}),
                     matte({0.2, 0.2, 0.2})};
  scene.materials[1].tinted_specular = true;
  scene.materials[2].texture = 0;
  scene.materials[3].emission = {0.6, 0.4, 0.1};
  scene.textures = {checker_texture()};
  TriangleMesh wall = rectangle_mesh({-3.71, -2.39, -1.87}, {7.43, 0.11, 0.23}, {0.07, 4.83, 0}, 2);
  wall.uvs = {{-0.31F, 1.27F}, {1.43F, 1.27F}, {1.43F, -0.19F}, {-0.31F, -0.19F}};
  scene.meshes = {wall, ball_mesh({-1.07, 0.13, 0.71}, 1.19, 6, 1),
                  box_mesh({0.63, -1.33, -0.41}, {1.87, 0.37, 0.89}, 0),
                  box_mesh({-0.27, 1.07, 0.53}, {0.49, 1.61, 0.97}, 3)};
  Light sun;
  sun.kind = Light::Kind::Directional;
  sun.direction = normalized(Vec3{0.53, -0.71, -0.83});
  sun.colour = {0.5, 0.48, 0.41};
  Light spot;
  spot.kind = Light::Kind::Spot;
  spot.position = {2.17, 3.31, 4.73};
  spot.direction = normalized(Vec3{-0.41, -0.57, -0.93});
  spot.colour = {9.0, 8.0, 11.0};
  spot.falls_off = true;
  spot.cos_inner = 0.97;
  spot.cos_outer = 0.86;
  scene.lights = {sun, spot};
  return {"meshes", scene};
}

NamedScene mirrors() {
  SceneDescription scene = named("mirrors");
  scene.materials = {plastic({0.75, 0.8, 0.7}), plastic({0.9, 0.7, 0.3}), matte({0.3, 0.6, 0.4})};
  scene.materials[0].specular = 0.6;
  scene.materials[1].specular = 0.8;
  scene.materials[1].tinted_specular = true;
  scene.spheres = {{.centre = {-0.93, 0.27, 0.33}, .radius = 1.21, .material = 1},
                   {.centre = {1.43, -0.51, 1.11}, .radius = 0.67, .material = 2}};
  scene.meshes = {rectangle_mesh({-4.01, -1.57, 4.03}, {8.07, 0.0, 0.0}, {0.0, 0.17, -8.11}, 0),
                  ball_mesh({1.21, 0.97, -0.73}, 0.83, 5, 1)};
  scene.lights = {point_light(kLightLeft, 0.6), point_light(kLightRight, 0.3)};
  return {"mirrors", scene};
}

NamedScene glasses() {
  SceneDescription scene = named("glass");
  scene.materials = {matte({0.8, 0.75, 0.3}), glass(1.5), glass(1.31), matte({0.3, 0.3, 0.7})};
  scene.materials[0].texture = 0;
  scene.textures = {checker_texture()};
  TriangleMesh wall = rectangle_mesh({-3.93, -2.21, -2.07}, {7.91, 0, 0.31}, {0.13, 4.57, 0}, 0);
  wall.uvs = {{0, 1}, {2.3F, 1}, {2.3F, 0}, {0, 0}};
  scene.spheres = {{.centre = {-1.19, 0.21, 0.47}, .radius = 1.13, .material = 1},
                   // A bubble inside the glass ball.
                   {.centre = {-1.27, 0.31, 0.51}, .radius = 0.43, .inward = true, .material = 1},
                   {.centre = {0.17, -1.03, -0.87}, .radius = 0.59, .material = 3}};
  scene.meshes = {wall, box_mesh({0.57, -1.11, -0.37}, {1.83, 0.87, 0.79}, 2)};
  scene.lights = {point_light(kLightLeft, 0.7), point_light(kLightRight, 0.5)};
  return {"glass", scene};
}

optics::SubpixelLayout layout_named(const std::string& name) {
  if (name != "cells") return optics::SubpixelLayout::named(name);
  std::vector<optics::PixelCell> cells;
  for (int k = 0; k < 4; ++k)
    cells.push_back({{{0.2 + 0.05 * k, 0.3}, {0.5, 0.7 - 0.1 * k}, {0.8, 0.4 + 0.07 * k}}});
  return optics::SubpixelLayout::cells(2, 2, cells);
}

}  // namespace

std::vector<NamedScene> tiny_scenes() {
  return {spheres_and_shadows(), cones_and_cylinders(), meshes_and_lights(), mirrors(), glasses()};
}

TriangleMesh rectangle_mesh(Vec3 corner, Vec3 a, Vec3 b, int material) {
  TriangleMesh mesh;
  mesh.name = "rectangle";
  mesh.material = material;
  mesh.positions = {corner, corner + a, corner + a + b, corner + b};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TriangleMesh box_mesh(Vec3 low, Vec3 high, int material) {
  TriangleMesh mesh;
  mesh.name = "box";
  mesh.material = material;
  for (int k = 0; k < 8; ++k)
    mesh.positions.push_back(
        {k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z});
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

TriangleMesh ball_mesh(Vec3 centre, double radius, int rings, int material) {
  TriangleMesh mesh;
  mesh.name = "ball";
  mesh.material = material;
  const int sectors = 2 * rings;
  for (int ring = 0; ring <= rings; ++ring)
    for (int sector = 0; sector < sectors; ++sector) {
      const double polar = std::numbers::pi * ring / rings;
      const double azimuth = 2.0 * std::numbers::pi * sector / sectors + 0.123;
      const Vec3 normal{std::sin(polar) * std::cos(azimuth), std::cos(polar),
                        std::sin(polar) * std::sin(azimuth)};
      mesh.normals.push_back(normal);
      mesh.positions.push_back(centre + normal * radius);
    }
  const auto vertex = [&](int ring, int sector) {
    return static_cast<uint32_t>(ring * sectors + sector % sectors);
  };
  for (int ring = 0; ring < rings; ++ring)
    for (int sector = 0; sector < sectors; ++sector) {
      const uint32_t a = vertex(ring, sector);
      const uint32_t b = vertex(ring, sector + 1);
      const uint32_t c = vertex(ring + 1, sector + 1);
      const uint32_t d = vertex(ring + 1, sector);
      if (ring != 0) mesh.triangles.push_back({a, b, c});
      if (ring != rings - 1) mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

optics::Rig make_rig(const TinyRig& tiny) {
  optics::Rig rig;
  rig.name = "tiny";
  rig.panel.width_px = tiny.width;
  rig.panel.height_px = tiny.height;
  rig.panel.pixel_width = Millimetres(tiny.pixel_mm);
  rig.panel.pixel_height = Millimetres(tiny.pixel_mm);
  rig.panel.layout = layout_named(tiny.layout);
  rig.sheet.pitch = Subpixels(tiny.pitch_subpx);
  rig.sheet.slant = tiny.slant;
  rig.sheet.offset = Lenses(0.137);
  // Lobes of about thirty degrees for every pitch.
  rig.sheet.gap = Millimetres(tiny.pitch_subpx * tiny.pixel_mm / 3.0 / 0.55);
  rig.sheet.refraction_shape = 1.0 / (1.49 * 1.49);
  rig.viewing.distance = Millimetres(tiny.distance_mm);
  rig.viewing.height = Millimetres(tiny.eye_height_mm);
  optics::validate_rig(rig, "tiny rig");
  return rig;
}

render::Stage make_tiny_stage(const TinyStage& tiny) {
  const double angle = tiny.turn_degrees * std::numbers::pi / 180.0;
  const double s = tiny.mm_per_unit;
  const double d = s * tiny.depth_scale;
  const double c = std::cos(angle);
  const double n = std::sin(angle);
  render::Stage stage;
  stage.panel_from_world = {{s * c, 0, -d * n}, {0, s, 0}, {s * n, 0, d * c}, {}};
  stage.panel_from_world.origin = -stage.panel_from_world.vector(tiny.centre);
  stage.world_from_panel = stage.panel_from_world.inverse();
  stage.world_from_panel.origin = tiny.centre;
  stage.mm_per_unit = s;
  stage.depth_scale = tiny.depth_scale;
  stage.near_mm = std::numeric_limits<double>::infinity();  // nothing is omitted
  return stage;
}

SceneDescription moved(SceneDescription scene, double scale, Vec3 offset) {
  const auto move = [&](Vec3& p) { p = p * scale + offset; };
  for (TriangleMesh& mesh : scene.meshes)
    for (Vec3& p : mesh.positions) move(p);
  for (Sphere& sphere : scene.spheres) {
    move(sphere.centre);
    sphere.radius *= scale;
  }
  for (Cone& cone : scene.cones) {
    move(cone.base);
    move(cone.apex);
    cone.base_radius *= scale;
    cone.apex_radius *= scale;
  }
  for (Light& light : scene.lights) {
    move(light.position);
    if (light.falls_off) light.colour = light.colour * (scale * scale);
  }
  return scene;
}

}  // namespace lenticule::test
