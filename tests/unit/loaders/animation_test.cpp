// SPDX-License-Identifier: Apache-2.0
// Tests at_time: key frames, hierarchies, and the transform of normals, lights and cameras.
#include "render/loaders/animation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;

using Quaternion = std::array<double, 4>;

Quaternion about_y(double degrees) {
  const double half = degrees * std::numbers::pi / 360.0;
  return {0, std::sin(half), 0, std::cos(half)};
}

void expect_near(Vec3 a, Vec3 b) {
  EXPECT_LT(length(a - b), 1e-12) << a.x << ' ' << a.y << ' ' << a.z;
}

/// Returns one triangle on one animated node.
SceneDescription moving_triangle() {
  SceneDescription scene;
  scene.nodes.resize(1);
  scene.nodes[0].animated = true;
  TriangleMesh mesh;
  mesh.positions = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  mesh.normals = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh.node = 0;
  scene.meshes = {mesh};
  return scene;
}

TEST(AtTime, BlendsTranslationsLinearlyAndHoldsBeyondTheEnds) {
  SceneDescription scene = moving_triangle();
  scene.nodes[0].translations = {.times = {1, 3}, .values = {{0, 0, 0}, {4, 8, 0}}};
  const auto first = [&](double t) { return at_time(scene, t).meshes[0].positions[0]; };
  expect_near(first(0), {1, 0, 0});
  expect_near(first(1.5), {2, 2, 0});
  expect_near(first(3), {5, 8, 0});
  expect_near(first(100), {5, 8, 0});
}

TEST(AtTime, RotationsTakeTheShorterArc) {
  SceneDescription scene = moving_triangle();
  Quaternion far = about_y(90);
  for (double& v : far) v = -v;  // the same rotation as the negated quaternion
  scene.nodes[0].rotations = {.times = {0, 1}, .values = {about_y(0), far}};
  const double c = std::sqrt(0.5);
  const SceneDescription half = at_time(scene, 0.5);
  expect_near(half.meshes[0].positions[0], {c, 0, -c});
  expect_near(half.meshes[0].normals[0], {c, 0, -c});
}

TEST(AtTime, NormalsStayAtRightAnglesUnderUnevenScale) {
  SceneDescription scene = moving_triangle();
  scene.nodes[0].scales = {.times = {0}, .values = {{4, 1, 1}}};
  TriangleMesh& mesh = scene.meshes[0];
  const Vec3 face = normalized(
      cross(mesh.positions[1] - mesh.positions[0], mesh.positions[2] - mesh.positions[0]));
  mesh.normals = {face, face, face};
  const TriangleMesh baked = at_time(scene, 0).meshes[0];
  EXPECT_NEAR(dot(baked.normals[0], baked.positions[1] - baked.positions[0]), 0.0, 1e-12);
  EXPECT_NEAR(dot(baked.normals[0], baked.positions[2] - baked.positions[0]), 0.0, 1e-12);
  EXPECT_NEAR(length(baked.normals[0]), 1.0, 1e-12);
}

TEST(AtTime, ASkinKeepsItsShapeFarFromTheOrigin) {
  SceneDescription scene = moving_triangle();
  scene.nodes.resize(3);
  scene.skins = {{.joints = {1, 2}, .joint_from_mesh = std::vector<Affine>(2)}};
  for (const size_t joint : {1, 2}) {
    scene.nodes[joint].animated = true;
    scene.nodes[joint].translations = {.times = {0}, .values = {{1e6, 0, 0}}};
  }
  // Weights of single precision, whose sum is not exactly 1.
  const std::vector<float> weights = {0.1F, 0.9F, 0.3F, 0.7F, 1.0F / 3.0F, 2.0F / 3.0F};
  ASSERT_NE(double{weights[0]} + double{weights[1]}, 1.0);
  scene.meshes[0].deformation = std::make_shared<Deformation>(Deformation{
      .skin = 0, .joints_per_vertex = 2, .joints = {0, 1, 0, 1, 0, 1}, .weights = weights});
  const auto at = at_time(scene, 0).meshes[0].positions;
  for (size_t i = 0; i < 3; ++i)
    EXPECT_LT(length(at[i] - (moving_triangle().meshes[0].positions[i] + Vec3{1e6, 0, 0})), 1e-9);
}

TEST(AtTime, MovesLightsAndCameras) {
  SceneDescription scene = moving_triangle();
  scene.nodes[0].rotations = {.times = {0, 1}, .values = {about_y(0), about_y(90)}};
  scene.nodes[0].translations = {.times = {0}, .values = {{0, 5, 0}}};
  Light light;
  light.position = {1, 0, 0};
  light.node = 0;
  scene.lights = {light};
  Camera camera;
  camera.from = {0, 0, 2};
  camera.at = {0, 0, 0};
  camera.node = 0;
  scene.cameras = {camera};
  const SceneDescription later = at_time(scene, 1);
  expect_near(later.lights[0].position, {0, 5, -1});
  expect_near(later.lights[0].direction, {-1, 0, 0});
  expect_near(later.cameras[0].from, {2, 5, 0});
  expect_near(later.cameras[0].at, {0, 5, 0});
  expect_near(later.cameras[0].up, {0, 1, 0});
}

TEST(AtTime, ANonFiniteVertexIsAnInputError) {
  SceneDescription scene = moving_triangle();
  scene.meshes[0].name = "wing";
  scene.nodes[0].scales = {.times = {0}, .values = {{std::numeric_limits<double>::max(), 1, 1}}};
  scene.meshes[0].positions[0] = {1e10, 0, 0};
  const Error error = error_of([&] { (void)at_time(scene, 0); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), ::testing::HasSubstr("wing"));
}

TEST(BakeStillNodes, KeepsOnlyMovingNodes) {
  SceneDescription scene = moving_triangle();
  scene.nodes.resize(3);
  scene.nodes[1].local.origin = {7, 0, 0};
  scene.nodes[2].parent = 0;  // still itself, but child of a moving node
  TriangleMesh still = scene.meshes[0];
  still.node = 1;
  TriangleMesh carried = still;
  carried.node = 2;
  scene.meshes.push_back(still);
  scene.meshes.push_back(carried);
  bake_still_nodes(scene);
  EXPECT_EQ(scene.meshes[0].node, 0);
  EXPECT_EQ(scene.meshes[1].node, -1);
  expect_near(scene.meshes[1].positions[0], {8, 0, 0});
  EXPECT_EQ(scene.meshes[2].node, 2);
}

}  // namespace
}  // namespace lenticule::render
