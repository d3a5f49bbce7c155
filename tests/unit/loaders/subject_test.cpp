// SPDX-License-Identifier: Apache-2.0
// Tests that the depth is fitted to what stands on a floor or before a wall, and that scenes
// without either keep the depth at which all of them fits.
#include "render/scene/subject.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

/// Returns a panel of 600 x 300 mm, seen from 700 mm.
optics::OpticalModel model() {
  optics::Rig rig;
  rig.panel.width_px = 6000;
  rig.panel.height_px = 3000;
  rig.panel.pixel_width = Millimetres(0.1);
  rig.panel.pixel_height = Millimetres(0.1);
  rig.sheet.pitch = Subpixels(8.0);
  rig.sheet.gap = Millimetres(2.0);
  rig.viewing.distance = Millimetres(700.0);
  return optics::OpticalModel(rig);
}

/// Returns a rectangle of count x count squares.
TriangleMesh rectangle(Vec3 corner, Vec3 a, Vec3 b, uint32_t count = 1) {
  TriangleMesh mesh;
  for (uint32_t j = 0; j <= count; ++j)
    for (uint32_t i = 0; i <= count; ++i)
      mesh.positions.push_back(corner + (a * i + b * j) / count);
  for (uint32_t j = 0; j < count; ++j)
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t at = j * (count + 1) + i;
      mesh.triangles.push_back({at, at + 1, at + count + 2});
      mesh.triangles.push_back({at, at + count + 2, at + count + 1});
    }
  return mesh;
}

void append(TriangleMesh& to, const TriangleMesh& from) {
  const auto first = static_cast<uint32_t>(to.positions.size());
  to.positions.insert(to.positions.end(), from.positions.begin(), from.positions.end());
  for (const auto& [a, b, c] : from.triangles)
    to.triangles.push_back({first + a, first + b, first + c});
}

TriangleMesh box(Vec3 low, Vec3 high) {
  const Vec3 x{high.x - low.x, 0, 0}, y{0, high.y - low.y, 0}, z{0, 0, high.z - low.z};
  TriangleMesh mesh = rectangle(low, x, y);
  for (const TriangleMesh& side :
       {rectangle(low + z, x, y), rectangle(low, x, z), rectangle(low + y, x, z),
        rectangle(low, z, y), rectangle(low + x, z, y)})
    append(mesh, side);
  return mesh;
}

/// Returns a model of 1 x 2 x 1 units that stands on y = 0.
SceneDescription figure(Vec3 at = {}) {
  SceneDescription scene;
  scene.source = "figure";
  scene.materials.resize(1);
  scene.meshes = {box(at + Vec3{-0.5, 0.0, -0.5}, at + Vec3{0.5, 1.0, 0.5})};
  scene.spheres = {{.centre = at + Vec3{0, 1.5, 0}, .radius = 0.5}};
  return scene;
}

TriangleMesh floor_of(double size, uint32_t count = 1) {
  return rectangle({-size / 2, 0, -size / 2}, {size, 0, 0}, {0, 0, size}, count);
}

Camera before_the_figure() {
  return {.from = {0, 2.0, 8.0}, .at = {0, 1.0, 0}, .vertical_fov_degrees = 30.0};
}

double deepest(const Interval& z) { return std::max(z.high, -z.low); }

TEST(Subject, OnAFloorIsDeeperThanIfAllWereFitted) {
  const optics::OpticalModel rig = model();
  const double budget = rig.depth_of_field_mm();
  for (const double size : {8.0, 20.0, 60.0, 150.0}) {
    SceneDescription scene = figure();
    scene.meshes.push_back(floor_of(size));
    const Stage stage = make_stage(scene, rig);
    ASSERT_FALSE(stage.subject_mm.empty()) << size;
    const double all = budget / std::max(stage.near_mm, -stage.far_mm) * stage.depth_scale;
    EXPECT_GE(stage.depth_scale, 3.9 * all) << size;
    EXPECT_LE(deepest(stage.subject_mm), budget * (1 + 1e-9)) << size;
    EXPECT_LE(stage.near_mm, 4.0 * budget * (1 + 1e-9)) << size;
  }
}

TEST(Subject, BeforeACameraIsAsDeepAsWithoutItsFloorAndWalls) {
  const optics::OpticalModel rig = model();
  SceneDescription scene = figure();
  scene.cameras = {before_the_figure()};
  const double alone = make_stage(scene, rig).depth_scale;
  EXPECT_LT(alone, 1.0);
  SceneDescription on_floor = scene;
  on_floor.meshes.push_back(floor_of(1e5));
  EXPECT_NEAR(make_stage(on_floor, rig).depth_scale, alone, 0.2 * alone);
  SceneDescription in_room = scene;
  in_room.meshes.push_back(box({-5, 0, -9}, {5, 6, 9}));
  EXPECT_NEAR(make_stage(in_room, rig).depth_scale, alone, 0.2 * alone);
  SceneDescription before_backdrop = scene;
  before_backdrop.meshes.push_back(rectangle({-9, -9, -12}, {18, 0, 0}, {0, 18, 0}));
  EXPECT_NEAR(make_stage(before_backdrop, rig).depth_scale, alone, 1e-9);
}

TEST(Subject, DoesNotDependOnHowTheFloorIsCut) {
  const optics::OpticalModel rig = model();
  SceneDescription whole = figure(), fine = figure(), joined = figure(), turned = figure();
  whole.meshes.push_back(floor_of(30.0));
  fine.meshes.push_back(floor_of(30.0, 60));
  append(joined.meshes[0], floor_of(30.0));
  turned.meshes.push_back(floor_of(30.0));
  for (auto& triangle : turned.meshes[1].triangles) std::swap(triangle[0], triangle[1]);
  const Stage stage = make_stage(whole, rig);
  ASSERT_FALSE(stage.subject_mm.empty());
  for (const SceneDescription& same : {fine, joined, turned})
    EXPECT_NEAR(make_stage(same, rig).depth_scale, stage.depth_scale, 1e-9);
}

TEST(Subject, StandsOnASlabAsOnAFloor) {
  const optics::OpticalModel rig = model();
  for (const double thick : {0.1, 0.5}) {
    SceneDescription scene = figure();
    scene.meshes.push_back(box({-10, -thick, -10}, {10, 0, 10}));
    EXPECT_FALSE(make_stage(scene, rig).subject_mm.empty()) << thick;
  }
}

TEST(Subject, OfATurningSceneStandsOnAFloorButNotBeforeAWall) {
  const optics::OpticalModel rig = model();
  SceneDescription on_floor = figure(), before_wall = figure();
  on_floor.meshes.push_back(floor_of(20.0));
  before_wall.meshes.push_back(rectangle({-10, 0, -6}, {20, 0, 0}, {0, 20, 0}));
  const StageOptions turning{.fit_every_turn = true};
  EXPECT_FALSE(make_stage(on_floor, rig, turning).subject_mm.empty());
  EXPECT_TRUE(make_stage(before_wall, rig, turning).subject_mm.empty());
  EXPECT_FALSE(make_stage(before_wall, rig).subject_mm.empty());
}

TEST(Subject, IsTheWholeSceneWithoutAFloor) {
  const optics::OpticalModel rig = model();
  SceneDescription ball;
  ball.materials.resize(1);
  ball.spheres = {{.radius = 1.0}};
  SceneDescription plain_box = ball;
  plain_box.spheres.clear();
  plain_box.meshes = {box({-1, -1, -1}, {1, 1, 1})};
  SceneDescription flat = plain_box;
  flat.meshes = {floor_of(10.0)};
  SceneDescription corner = plain_box;
  corner.meshes = {floor_of(10.0), rectangle({-5, 0, -5}, {10, 0, 0}, {0, 10, 0})};
  SceneDescription table = plain_box;
  table.meshes = {box({-3, 2.9, -3}, {3, 3, 3})};
  for (const double x : {-3.0, 2.8})
    for (const double z : {-3.0, 2.8})
      table.meshes.push_back(box({x, 0, z}, {x + 0.2, 3, z + 0.2}));
  for (const SceneDescription& scene : {figure(), ball, plain_box, flat, corner, table})
    for (const double turn : {0.0, 33.0, 120.0}) {
      const Stage stage = make_stage(scene, rig, {.turn_degrees = turn});
      EXPECT_TRUE(stage.subject_mm.empty());
      const double depth = std::max(stage.near_mm, -stage.far_mm);
      EXPECT_TRUE(stage.depth_scale == 1.0 ||
                  std::abs(depth - rig.depth_of_field_mm()) < 1e-9 * depth);
    }
}

TEST(Subject, DoesNotChangeADepthThatTheUserChooses) {
  SceneDescription scene = figure();
  scene.meshes.push_back(floor_of(30.0));
  const Stage stage = make_stage(scene, model(), {.depth_scale = 0.3});
  EXPECT_EQ(stage.depth_scale, 0.3);
  EXPECT_TRUE(stage.subject_mm.empty());
  const Stage whole = make_stage(scene, model(), {.whole_depth = true});
  EXPECT_NEAR(-whole.far_mm, whole.depth_of_field_mm, 1e-9);
}

TEST(Subject, IsTheSameForEveryUnit) {
  const optics::OpticalModel rig = model();
  for (const bool camera : {false, true}) {
    SceneDescription scene = figure({0.3, 0, -0.2});
    scene.meshes.push_back(floor_of(30.0));
    if (camera) scene.cameras = {before_the_figure()};
    const Stage stage = make_stage(scene, rig);
    for (const double unit : {1e-4, 1e4}) {
      SceneDescription scaled = scene;
      for (TriangleMesh& mesh : scaled.meshes)
        for (Vec3& p : mesh.positions) p = p * unit;
      for (Sphere& sphere : scaled.spheres)
        sphere = {.centre = sphere.centre * unit, .radius = sphere.radius * unit};
      for (Camera& each : scaled.cameras) {
        each.from = each.from * unit;
        each.at = each.at * unit;
      }
      EXPECT_NEAR(make_stage(scaled, rig).depth_scale, stage.depth_scale, 1e-9);
    }
  }
}

}  // namespace
}  // namespace lenticule::render
