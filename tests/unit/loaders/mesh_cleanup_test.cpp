// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/mesh_cleanup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace lenticule::render {
namespace {

TriangleMesh two_triangles() {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 1, 3}};
  return mesh;
}

TEST(MeshCleanup, DropsTrianglesWithoutAnArea) {
  TriangleMesh mesh = two_triangles();
  EXPECT_EQ(clean(mesh).dropped_triangles, 1U);
  EXPECT_THAT(mesh.triangles, ::testing::ElementsAre(std::array<uint32_t, 3>{0, 1, 2}));
}

TEST(MeshCleanup, KeepsTinyTriangles) {
  TriangleMesh mesh = two_triangles();
  for (Vec3& p : mesh.positions) p = p * 1e-9;
  EXPECT_EQ(clean(mesh).dropped_triangles, 1U);
}

TEST(MeshCleanup, RecomputesUnusableNormalsAndNormalizesTheRest) {
  TriangleMesh mesh = two_triangles();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  mesh.normals = {{0, 0, 0}, {nan, 0, 1}, {0, 3, 4}, {0, 0, 0}};
  EXPECT_EQ(clean(mesh).recomputed_normals, 3U);
  EXPECT_EQ(mesh.normals[0], (Vec3{0, 0, 1}));
  EXPECT_EQ(mesh.normals[1], (Vec3{0, 0, 1}));
  EXPECT_EQ(mesh.normals[2], (Vec3{0, 0.6, 0.8}));
  EXPECT_NEAR(length(mesh.normals[3]), 1.0, 1e-12) << "a vertex without a face still has one";
}

}  // namespace
}  // namespace lenticule::render
