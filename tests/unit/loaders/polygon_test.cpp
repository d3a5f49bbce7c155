// SPDX-License-Identifier: Apache-2.0
// Tests the triangulation of polygons that fans and naive ear clipping get wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

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

TEST(Polygon, ATriangleStaysItself) {
  const Triangulation cut = triangulate(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  EXPECT_THAT(cut.triangles, ::testing::ElementsAre(std::array<uint32_t, 3>{0, 1, 2}));
}

TEST(Polygon, AGearFaceIsCovered) {
  // 36 teeth, 144 corners: square teeth between two radii.
  std::vector<Vec3> corners;
  for (int i = 0; i < 144; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 144.0;
    const double radius = i % 4 < 2 ? 1.0 : 0.85;
    corners.push_back({radius * std::cos(angle), 2.0, -radius * std::sin(angle)});
  }
  const double expected = length(polygon_area_vector(corners)) / 2.0;
  EXPECT_THAT(triangulate(corners).triangles, ::testing::SizeIs(142));
  expect_covered(corners, expected);
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

TEST(Polygon, ACombIsCovered) {
  std::vector<Vec3> corners{{0, 0, 5}};
  constexpr int kTeeth = 50;
  for (int i = kTeeth; i > 0; --i) {
    corners.push_back({static_cast<double>(i), 10.0, 5});
    corners.push_back({i - 0.5, 1.0, 5});
  }
  corners.push_back({0, 1, 5});
  corners.front() = {static_cast<double>(kTeeth), 0, 5};
  corners.insert(corners.begin(), {0, 0, 5});
  const double expected = length(polygon_area_vector(corners)) / 2.0;
  expect_covered(corners, expected);
}

TEST(Polygon, LiesInAnyPlaneAtAnyScale) {
  for (const double scale : {1e-6, 1.0, 1e6}) {
    for (const Vec3 offset : {Vec3{}, Vec3{1e3, -2e3, 3e3}}) {
      std::vector<Vec3> corners;
      for (const Vec3 p :
           {Vec3{0, 0, 0}, Vec3{4, 0, 1}, Vec3{4, 4, 3}, Vec3{2, 1, 1}, Vec3{0, 4, 2}})
        corners.push_back((p + offset) * scale);
      expect_covered(corners, length(polygon_area_vector(corners)) / 2.0);
    }
  }
}

TEST(Polygon, WithoutAnAreaGivesNoTriangles) {
  EXPECT_THAT(triangulate(std::vector<Vec3>{}).triangles, ::testing::IsEmpty());
  EXPECT_THAT(triangulate(std::vector<Vec3>{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}).triangles,
              ::testing::IsEmpty());
  EXPECT_THAT(triangulate(std::vector<Vec3>{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}}).triangles,
              ::testing::IsEmpty());
}

TEST(Polygon, ASelfIntersectingOutlineTerminatesAndIsReported) {
  // A pentagram with unequal arms: its outline crosses itself five times.
  std::vector<Vec3> corners;
  for (int i = 0; i < 5; ++i) {
    const double angle = 4.0 * std::numbers::pi * i / 5.0;
    corners.push_back({(1.0 + 0.1 * i) * std::cos(angle), std::sin(angle), 0});
  }
  const Triangulation cut = triangulate(corners);
  EXPECT_FALSE(cut.triangles.empty());
  EXPECT_LE(cut.triangles.size(), 3U);
}

}  // namespace
}  // namespace lenticule::render
