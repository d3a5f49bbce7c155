// SPDX-License-Identifier: Apache-2.0
// Tests that for any simple polygon the triangles cover exactly its area and have its orientation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "render/loaders/mesh_cleanup.h"

namespace lenticule::render {
namespace {

using Outline = std::vector<Vec2>;

/// Returns a polygon that is star-shaped about the origin: any radii at ascending angles make it
/// simple.
Outline random_star(std::mt19937& random, int corners) {
  std::uniform_real_distribution<double> radius(0.05, 1.0);
  std::uniform_real_distribution<double> jitter(0.0, 0.9);
  Outline outline;
  for (int i = 0; i < corners; ++i) {
    const double angle = 2.0 * std::numbers::pi * (i + jitter(random)) / corners;
    const double r = radius(random);
    outline.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  return outline;
}

/// Returns a band that winds inward: far from star-shaped, with many concave corners.
Outline random_spiral(std::mt19937& random, int corners) {
  std::uniform_real_distribution<double> jitter(-0.02, 0.02);
  Outline outer;
  Outline inner;
  for (int i = 0; i < corners / 2; ++i) {
    const double angle = 0.3 * i;
    const double r = 1.0 + 0.1 * angle;
    outer.push_back({(r + 0.2 + jitter(random)) * std::cos(angle), (r + 0.2) * std::sin(angle)});
    inner.push_back({(r + jitter(random)) * std::cos(angle), r * std::sin(angle)});
  }
  outer.insert(outer.end(), inner.rbegin(), inner.rend());
  return outer;
}

/// Places an outline in a random plane, at a random place and scale.
std::vector<Vec3> placed(std::mt19937& random, const Outline& outline) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vec3 normal{unit(random), unit(random), unit(random)};
  if (length(normal) < 0.1) normal = {0, 0, 1};
  normal = normalized(normal);
  const Vec3 u =
      normalized(cross(normal, std::abs(normal.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const Vec3 v = cross(normal, u);
  const double scale = std::pow(10.0, 6.0 * unit(random));
  const Vec3 origin = Vec3{unit(random), unit(random), unit(random)} * (10.0 * scale);
  std::vector<Vec3> corners;
  for (const Vec2 p : outline) corners.push_back(origin + (u * p.x + v * p.y) * scale);
  return corners;
}

void expect_exactly_covered(const std::vector<Vec3>& corners) {
  const Vec3 area = polygon_area_vector(corners);
  const Triangulation cut = triangulate(corners);
  ASSERT_TRUE(cut.simple);
  ASSERT_LE(cut.triangles.size(), corners.size() - 2);
  double sum = 0.0;
  for (const auto& [a, b, c] : cut.triangles) {
    const double part =
        dot(normalized(area), cross(corners[b] - corners[a], corners[c] - corners[a]));
    ASSERT_GE(part, -1e-12 * length(area));
    sum += part;
  }
  ASSERT_NEAR(sum, length(area), 1e-9 * length(area));
}

TEST(PolygonProperty, TrianglesCoverRandomStars) {
  std::mt19937 random(7);
  for (int round = 0; round < 2000; ++round)
    expect_exactly_covered(placed(random, random_star(random, 3 + round % 60)));
}

TEST(PolygonProperty, TrianglesCoverRandomSpirals) {
  std::mt19937 random(11);
  for (int round = 0; round < 400; ++round)
    expect_exactly_covered(placed(random, random_spiral(random, 20 + round % 200)));
}

// Clockwise outlines and any start corner give the same area.
TEST(PolygonProperty, DirectionAndStartDoNotMatter) {
  std::mt19937 random(13);
  for (int round = 0; round < 300; ++round) {
    std::vector<Vec3> corners = placed(random, random_star(random, 24));
    std::rotate(corners.begin(), corners.begin() + round % 24, corners.end());
    expect_exactly_covered(corners);
    std::reverse(corners.begin(), corners.end());
    expect_exactly_covered(corners);
  }
}

// Corners on a small integer grid: many collinear and coinciding ones, outlines that cross. Only
// termination and indices in range are required.
TEST(PolygonProperty, TerminatesForAnyOutline) {
  std::mt19937 random(17);
  std::uniform_int_distribution<int> place(0, 4);
  for (int round = 0; round < 5000; ++round) {
    std::vector<Vec3> corners;
    for (int i = 0; i < 3 + round % 20; ++i)
      corners.push_back(
          {static_cast<double>(place(random)), static_cast<double>(place(random)), 1});
    const Triangulation cut = triangulate(corners);
    ASSERT_LE(cut.triangles.size(), corners.size());
    for (const auto& triangle : cut.triangles)
      for (const uint32_t corner : triangle) ASSERT_LT(corner, corners.size());
  }
}

}  // namespace
}  // namespace lenticule::render
