// SPDX-License-Identifier: Apache-2.0
// Tests the triangulation of polygons that fans and naive ear clipping get wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render/loaders/mesh_cleanup.h"

namespace lenticule::render {
namespace {

double area(const std::vector<Vec3>& corners, const Triangulation& cut) {
  double sum = 0.0;
  for (const auto& [a, b, c] : cut.triangles)
    sum += length(cross(corners[b] - corners[a], corners[c] - corners[a])) / 2.0;
  return sum;
}

/// Returns the sum of signed areas along the polygon's normal; equal to area() only if no triangle
/// is flipped.
double signed_area(const std::vector<Vec3>& corners, const Triangulation& cut) {
  const Vec3 normal = normalized(polygon_area_vector(corners));
  double sum = 0.0;
  for (const auto& [a, b, c] : cut.triangles)
    sum += dot(normal, cross(corners[b] - corners[a], corners[c] - corners[a])) / 2.0;
  return sum;
}

void expect_covered(const std::vector<Vec3>& corners, double expected) {
  const Triangulation cut = triangulate(corners);
  EXPECT_TRUE(cut.simple);
  EXPECT_NEAR(area(corners, cut), expected, 1e-9 * expected);
  EXPECT_NEAR(signed_area(corners, cut), expected, 1e-9 * expected);
}

TEST(Polygon, AHoleJoinedByADoubleEdgeStaysOpen) {
  const std::vector<Vec3> corners{{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {0, 0, 0},
                                  {1, 1, 0}, {1, 3, 0}, {3, 3, 0}, {3, 1, 0}, {1, 1, 0}};
  expect_covered(corners, 12.0);
}

TEST(Polygon, AcceptsCollinearAndRepeatedCorners) {
  expect_covered({{0, 0, 0},
                  {1, 0, 0},
                  {1, 0, 0},
                  {2, 0, 0},
                  {2, 1, 0},
                  {2, 2, 0},
                  {1, 2, 0},
                  {0, 2, 0},
                  {0, 1, 0},
                  {0, 0, 0}},
                 4.0);
}

TEST(Polygon, WithoutAnAreaGivesNoTriangles) {
  EXPECT_THAT(triangulate(std::vector<Vec3>{}).triangles, ::testing::IsEmpty());
  EXPECT_THAT(triangulate(std::vector<Vec3>{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}).triangles,
              ::testing::IsEmpty());
  EXPECT_THAT(triangulate(std::vector<Vec3>{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}}).triangles,
              ::testing::IsEmpty());
}

}  // namespace
}  // namespace lenticule::render
