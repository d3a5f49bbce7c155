// SPDX-License-Identifier: Apache-2.0
#include "render/scene/surface_groups.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

SceneDescription scene_of(std::vector<TriangleMesh> meshes) {
  SceneDescription scene;
  scene.materials = {Material{.name = "plain"}, Material{.name = "mirror", .specular = 0.5},
                     Material{.name = "glass", .transmittance = 0.9}};
  scene.meshes = std::move(meshes);
  return scene;
}

std::set<uint32_t> groups_of(const SurfaceGroups& groups, uint32_t geometry, size_t primitives) {
  std::set<uint32_t> found;
  for (uint32_t n = 0; n < primitives; ++n) found.insert(groups.of(geometry, n));
  return found;
}

TEST(SurfaceGroups, ABoxHasSixSurfaces) {
  const Scene scene(scene_of({test::box_mesh({-1, -1, -1}, {1, 2, 3}, 0)}), test::make_tiny_stage(),
                    {});
  const SurfaceGroups groups(scene);
  EXPECT_EQ(groups_of(groups, 0, 12).size(), 6U);
}

TEST(SurfaceGroups, ASmoothMeshIsOneSurface) {
  const TriangleMesh ball = test::ball_mesh({0, 0, 0}, 1.0, 9, 0);
  const size_t triangles = ball.triangles.size();
  const Scene scene(scene_of({ball}), test::make_tiny_stage(), {});
  EXPECT_EQ(groups_of(SurfaceGroups(scene), 0, triangles).size(), 1U);
}

TEST(SurfaceGroups, ASmoothMeshWithFacetedNormalsIsManySurfaces) {
  TriangleMesh ball = test::ball_mesh({0, 0, 0}, 1.0, 9, 0);
  ball.normals.clear();
  const size_t triangles = ball.triangles.size();
  const Scene scene(scene_of({ball}), test::make_tiny_stage(), {});
  const size_t count = groups_of(SurfaceGroups(scene), 0, triangles).size();
  EXPECT_GT(count, triangles / 3);  // quadrilaterals may be flat
  EXPECT_LE(count, triangles);
}

TEST(SurfaceGroups, RepeatedVerticesAreMerged) {
  TriangleMesh sheet = test::rectangle_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0);
  TriangleMesh split;
  for (const auto& triangle : sheet.triangles) {
    const auto first = static_cast<uint32_t>(split.positions.size());
    for (const uint32_t corner : triangle) split.positions.push_back(sheet.positions[corner]);
    split.triangles.push_back({first, first + 1, first + 2});
  }
  const Scene scene(scene_of({split}), test::make_tiny_stage(), {});
  EXPECT_EQ(groups_of(SurfaceGroups(scene), 0, 2).size(), 1U);
}

TEST(SurfaceGroups, MeshesSpheresAndConesAreSeparateAndHaveTheirViewDependence) {
  SceneDescription description = scene_of(
      {test::box_mesh({-1, -1, -1}, {1, 1, 1}, 0), test::box_mesh({-1, -1, -1}, {1, 1, 1}, 1)});
  description.spheres = {Sphere{.centre = {3, 0, 0}, .radius = 1.0, .material = 2},
                         Sphere{.centre = {-3, 0, 0}, .radius = 1.0, .material = 0}};
  description.cones = {Cone{.base = {0, 3, 0}, .apex = {0, 4, 0}, .material = 1}};
  const Scene scene(description, test::make_tiny_stage(), {});
  const SurfaceGroups groups(scene);
  std::set<uint32_t> all;
  size_t primitives = 0;
  for (uint32_t g = 0; g < scene.geometries.size(); ++g) {
    const auto kind = scene.geometries[g].kind;
    const size_t count = kind == GeometryEntry::Kind::Mesh      ? 12
                         : kind == GeometryEntry::Kind::Spheres ? 2
                                                                : 1;
    const std::set<uint32_t> found = groups_of(groups, g, count);
    primitives += found.size();
    all.insert(found.begin(), found.end());
    if (kind == GeometryEntry::Kind::Cones) {
      EXPECT_TRUE(SurfaceGroups::depends_on_view(groups.of(g, 0)));
    }
    if (kind == GeometryEntry::Kind::Spheres) {
      EXPECT_TRUE(SurfaceGroups::depends_on_view(groups.of(g, 0)));
      EXPECT_FALSE(SurfaceGroups::depends_on_view(groups.of(g, 1)));
    }
  }
  EXPECT_EQ(all.size(), primitives);
  EXPECT_EQ(primitives, 6U + 6U + 2U + 1U);
  EXPECT_EQ(all.count(SurfaceGroups::kNothing), 0U);
}

}  // namespace
}  // namespace lenticule::render
