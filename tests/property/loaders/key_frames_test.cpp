// SPDX-License-Identifier: Apache-2.0
// Tests that at the time of a key the scene has the key's pose, and that it moves between keys
// without a jump.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render/scene/scene_description.h"

namespace lenticule::render {
namespace {

using Quaternion = std::array<double, 4>;

struct Keys {
  std::vector<double> times;
  std::vector<Vec3> translations;
  std::vector<Quaternion> rotations;
  std::vector<Vec3> scales;
};

Keys random_keys(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::uniform_real_distribution<double> gap(0.01, 1.0);
  Keys keys;
  double time = unit(random);
  for (int i = 0; i < 6; ++i) {
    keys.times.push_back(time += gap(random));
    keys.translations.push_back({unit(random), unit(random), unit(random)});
    Quaternion q{unit(random), unit(random), unit(random), unit(random) + 2.0};
    const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& v : q) v /= n;
    keys.rotations.push_back(q);
    keys.scales.push_back({unit(random) + 2, unit(random) + 2, unit(random) + 2});
  }
  return keys;
}

SceneDescription scene_of(const Keys& keys) {
  SceneDescription scene;
  scene.nodes.resize(1);
  Node& node = scene.nodes[0];
  node.animated = true;
  node.translations = {.times = keys.times, .values = keys.translations};
  node.rotations = {.times = keys.times, .values = keys.rotations};
  node.scales = {.times = keys.times, .values = keys.scales};
  TriangleMesh mesh;
  mesh.positions = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh.node = 0;
  scene.meshes = {mesh};
  return scene;
}

/// Computes q v q* with cross products, a formula independent of the code's matrix.
Vec3 rotated(const Quaternion& q, Vec3 v) {
  const Vec3 axis{q[0], q[1], q[2]};
  const Vec3 t = cross(axis, v) * 2.0;
  return v + t * q[3] + cross(axis, t);
}

TEST(KeyFrames, AtAKeyTheSceneHasTheKeysPose) {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    const Keys keys = random_keys(random);
    const SceneDescription scene = scene_of(keys);
    for (size_t k = 0; k < keys.times.size(); ++k) {
      const TriangleMesh baked = at_time(scene, keys.times[k]).meshes[0];
      for (size_t i = 0; i < 4; ++i) {
        const Vec3 expected =
            keys.translations[k] +
            rotated(keys.rotations[k], scene.meshes[0].positions[i] * keys.scales[k]);
        ASSERT_LT(length(baked.positions[i] - expected), 1e-12);
      }
    }
  }
}

TEST(KeyFrames, MotionHasNoJumps) {
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    const Keys keys = random_keys(random);
    const SceneDescription scene = scene_of(keys);
    constexpr double kStep = 1e-6;
    for (const double key : keys.times) {
      const Vec3 before = at_time(scene, key - kStep).meshes[0].positions[0];
      const Vec3 after = at_time(scene, key + kStep).meshes[0].positions[0];
      ASSERT_LT(length(after - before), 1e-3);
    }
  }
}

TEST(KeyFrames, RotationsNeverStretch) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> moment(-2.0, 8.0);
  for (int round = 0; round < 200; ++round) {
    Keys keys = random_keys(random);
    keys.scales.assign(keys.scales.size(), {1, 1, 1});
    const TriangleMesh baked = at_time(scene_of(keys), moment(random)).meshes[0];
    for (size_t i = 0; i < 3; ++i)
      ASSERT_NEAR(length(baked.positions[i] - baked.positions[3]), 1.0, 1e-12);
  }
}

}  // namespace
}  // namespace lenticule::render
