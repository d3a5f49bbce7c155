// SPDX-License-Identifier: Apache-2.0
// Features of glTF, each with a small generated model and what the loader makes of it.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <vector>

#include "render/loaders/gltf_loader.h"
#include "tests/support/gltf_model.h"

namespace lenticule::render {

/// GltfFeatureCase is a feature: how the quad is changed, and what the loader makes of it.
struct GltfFeatureCase {
  const char* name;
  std::function<void(test::GltfModel&)> change;
  std::function<void(const SceneDescription&)> expect;
};

/// Returns primitives, attributes of vertices, and compressed meshes.
std::vector<GltfFeatureCase> gltf_geometry_features();
/// Returns placements of nodes, cameras and lights.
std::vector<GltfFeatureCase> gltf_node_features();
/// Returns animations, morph targets and skins.
std::vector<GltfFeatureCase> gltf_motion_features();
/// Returns factors, textures and extensions of materials.
std::vector<GltfFeatureCase> gltf_material_features();

inline void expect_close(Vec3 a, Vec3 b, double tolerance = 1e-5) {
  EXPECT_LT(length(a - b), tolerance) << a.x << ' ' << a.y << ' ' << a.z;
}

inline const TriangleMesh& only_mesh(const SceneDescription& scene) {
  EXPECT_THAT(scene.meshes, ::testing::SizeIs(1));
  return scene.meshes.at(0);
}

inline const PbrMaterial& pbr_of(const SceneDescription& scene) {
  return *scene.materials.at(static_cast<size_t>(only_mesh(scene).material)).pbr;
}

/// Expects the quad as the model's constructor makes it.
inline void expect_quad(const SceneDescription& scene, double tolerance = 1e-6) {
  const TriangleMesh& mesh = only_mesh(scene);
  ASSERT_THAT(mesh.positions, ::testing::SizeIs(4));
  expect_close(mesh.positions[0], {0, 0, 0}, tolerance);
  expect_close(mesh.positions[1], {1, 0, 0}, tolerance);
  expect_close(mesh.positions[2], {1, 1, 0}, tolerance);
  expect_close(mesh.positions[3], {0, 1, 0}, tolerance);
  EXPECT_THAT(mesh.triangles, ::testing::ElementsAre(std::array<uint32_t, 3>{0, 1, 2},
                                                     std::array<uint32_t, 3>{0, 2, 3}));
}

/// Expects triangles of this total area that face +z.
inline void expect_area(const SceneDescription& scene, double area) {
  double sum = 0.0;
  for (const TriangleMesh& mesh : scene.meshes)
    for (const auto& [a, b, c] : mesh.triangles)
      sum += cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]).z;
  EXPECT_NEAR(sum / 2.0, area, 1e-5);
}

inline nlohmann::json texture_info(int texture) {
  return {{"index", texture}};
}

}  // namespace lenticule::render
