// SPDX-License-Identifier: Apache-2.0
// Tests the teapot's mesh against known facts of the original: its size, its symmetry, its
// openings.
#include "scenes/teapot_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

namespace lenticule::scenes {
namespace {

using Point = std::array<double, 3>;

Point point(Vec3 p) { return {p.x + 0.0, p.y + 0.0, p.z + 0.0}; }

std::vector<Vec3> all_positions(const std::vector<SurfaceTriangle>& triangles) {
  std::vector<Vec3> positions;
  for (const SurfaceTriangle& triangle : triangles)
    for (const SurfacePoint& corner : triangle) positions.push_back(corner.position);
  return positions;
}

TEST(TeapotMesh, HasTheOriginalsExtents) {
  Vec3 low{9, 9, 9};
  Vec3 high{-9, -9, -9};
  for (const Vec3 p : all_positions(teapot_triangles(32))) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  EXPECT_NEAR(low.x, -3.0, 1e-3);
  EXPECT_NEAR(high.x, 3.434, 1e-3);
  EXPECT_NEAR(low.y, -2.0, 1e-3);
  EXPECT_NEAR(high.y, 2.0, 1e-3);
  EXPECT_NEAR(low.z, 0.0, 1e-12);
  EXPECT_NEAR(high.z, 3.15, 1e-12);
}

TEST(TeapotMesh, NormalsAreUnitVectorsOnTheFrontSide) {
  for (const int size : {3, 16}) {
    for (const auto& [a, b, c] : teapot_triangles(size)) {
      const Vec3 face = normalized(cross(b.position - a.position, c.position - a.position));
      for (const SurfacePoint& corner : {a, b, c}) ASSERT_NEAR(length(corner.normal), 1.0, 1e-12);
      // Single corners of a coarse spout may lean away, but not their mean.
      ASSERT_GT(dot(face, a.normal + b.normal + c.normal), 0.0) << "size " << size;
    }
  }
}

TEST(TeapotMesh, EnclosesAVolumeAndFacesOutward) {
  double six_volumes = 0.0;
  for (const auto& [a, b, c] : teapot_triangles(16))
    six_volumes += dot(a.position, cross(b.position, c.position));
  // A cylinder of radius 2 and height 2.4 has a volume of 30; the teapot is slimmer and has a
  // handle.
  EXPECT_GT(six_volumes / 6.0, 20.0);
  EXPECT_LT(six_volumes / 6.0, 30.0);
}

// Neighbouring patches share their edges to the last bit. The rims that the original leaves open
// stay open: lid and pot's mouth (4 arcs each), both ends of handle and spout (2 halves each).
TEST(TeapotMesh, IsWatertightExceptForTheOriginalsRims) {
  constexpr int kSize = 9;
  std::map<std::pair<Point, Point>, int> edges;
  for (const SurfaceTriangle& t : teapot_triangles(kSize))
    for (size_t k = 0; k < 3; ++k) ++edges[{point(t[k].position), point(t[(k + 1) % 3].position)}];
  int open = 0;
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    open += edges.contains({edge.second, edge.first}) ? 0 : 1;
  }
  EXPECT_EQ(open, (4 + 4 + 4 + 4) * kSize);
}

}  // namespace
}  // namespace lenticule::scenes
