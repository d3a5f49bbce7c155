// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "render/accel/primitives.h"

namespace lenticule::render {
namespace {

ConeShape cone(Vec3 base, Vec3 apex, double base_radius, double apex_radius) {
  const double height = length(apex - base);
  return {.base = base,
          .axis = (apex - base) / height,
          .height = height,
          .base_radius = base_radius,
          .slope = (apex_radius - base_radius) / height};
}

TEST(QuadraticRoots, AreAscending) {
  for (const double sign : {1.0, -1.0}) {
    const Roots roots = quadratic_roots(sign * 2.0, sign * -5.0, sign * 8.0);  // t = 1, 4
    ASSERT_EQ(roots.count, 2);
    EXPECT_DOUBLE_EQ(roots.t[0], 1.0);
    EXPECT_DOUBLE_EQ(roots.t[1], 4.0);
  }
}

TEST(QuadraticRoots, KeepTheSmallRootWithoutCancellation) {
  // t^2 - 2e8 t + 1: the small root is 5e-9, of which the textbook formula keeps no digit.
  const Roots roots = quadratic_roots(1.0, -1e8, 1.0);
  ASSERT_EQ(roots.count, 2);
  EXPECT_NEAR(roots.t[0], 5e-9, 1e-21);
}

TEST(QuadraticRoots, HaveOneRootForALinearEquation) {
  const Roots roots = quadratic_roots(0.0, 2.0, -8.0);
  ASSERT_EQ(roots.count, 1);
  EXPECT_DOUBLE_EQ(roots.t[0], 2.0);
}

TEST(QuadraticRoots, AreNoneForNonFiniteCoefficients) {
  EXPECT_EQ(quadratic_roots(1.0, std::nan(""), 1.0).count, 0);
  EXPECT_EQ(quadratic_roots(1.0, 0.0, 1.0).count, 0);
}

TEST(FirstRoot, IsTheNearestInsideTheRange) {
  const Roots roots{.count = 2, .t = {1.0, 4.0}};
  EXPECT_EQ(first_root(roots, 0.0, 10.0), 1.0);
  EXPECT_EQ(first_root(roots, 2.0, 10.0), 4.0);
  EXPECT_EQ(first_root(roots, 5.0, 10.0), 10.0);
  EXPECT_EQ(first_root(roots, 0.0, 0.5), 0.5);
}

TEST(Sphere, IsHitOnItsSurfaceFromAMillionRadiiAway) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const SphereShape sphere{.centre = {3.0, -2.0, 5.0}, .radius = 0.7};
  for (int n = 0; n < 1000; ++n) {
    const Vec3 from =
        sphere.centre + normalized(Vec3{unit(random), unit(random), unit(random)}) * 7e5;
    const Vec3 aim = sphere.centre + Vec3{unit(random), unit(random), unit(random)} * 0.3;
    const Vec3 direction = normalized(aim - from);
    const Roots roots = meet(sphere, from, direction);
    ASSERT_EQ(roots.count, 2);
    const Vec3 point = project_onto(sphere, from + direction * roots.t[0]);
    EXPECT_NEAR(length(point - sphere.centre), sphere.radius, 1e-15);
    EXPECT_NEAR(length(point - (from + direction * roots.t[0])), 0.0, 1e-8);
    EXPECT_LT(dot(outer_normal(sphere, point), direction), 0.0);
  }
}

TEST(Cone, IsOpenAtBothEnds) {
  const ConeShape tube = cone({0, 0, 0}, {0, 2, 0}, 1.0, 1.0);
  EXPECT_EQ(meet(tube, {0, 5, 0}, {0, -1, 0}).count, 0);
  EXPECT_EQ(meet(tube, {5, 1, 0}, {-1, 0, 0}).count, 2);
  EXPECT_EQ(meet(tube, {5, 2.001, 0}, {-1, 0, 0}).count, 0);
  EXPECT_EQ(meet(tube, {5, -0.001, 0}, {-1, 0, 0}).count, 0);
}

TEST(Cone, HasItsRadiusAtEveryHeight) {
  const ConeShape shape = cone({1, 1, 1}, {1, 4, 1}, 2.0, 0.5);
  for (const double s : {0.0, 0.7, 1.9, 3.0}) {
    const Roots roots = meet(shape, {11.0, 1.0 + s, 1.0}, {-1, 0, 0});
    ASSERT_EQ(roots.count, 2) << s;
    EXPECT_NEAR(10.0 - roots.t[0], 2.0 - 0.5 * s, 1e-12);
    EXPECT_NEAR(roots.t[1] - 10.0, 2.0 - 0.5 * s, 1e-12);
  }
}

TEST(Cone, EndsAtItsTip) {
  const ConeShape shape = cone({0, 0, 0}, {0, 1, 0}, 1.0, 0.0);
  EXPECT_EQ(meet(shape, {5, 1.5, 0}, {-1, 0, 0}).count, 0);
  EXPECT_EQ(meet(shape, {5, 0.5, 0}, {-1, 0, 0}).count, 2);
}

TEST(Cone, NormalIsPerpendicularToItsSideAndFlipsWithInward) {
  ConeShape shape = cone({0, 0, 0}, {0, 3, 0}, 2.0, 0.5);
  const Vec3 point = project_onto(shape, {1.2, 1.1, 0.3});
  const Vec3 normal = outer_normal(shape, point);
  const Vec3 side = Vec3{0, 4, 0} - point;  // the tip would be at y = 4
  EXPECT_NEAR(dot(normal, side), 0.0, 1e-12);
  EXPECT_GT(dot(normal, {1.2, 0, 0.3}), 0.0);
  shape.inward = true;
  EXPECT_EQ(outer_normal(shape, point), -normal);
}

TEST(Cone, HasNoNormalOnItsAxis) {
  const ConeShape shape = cone({0, 0, 0}, {0, 1, 0}, 1.0, 0.0);
  EXPECT_EQ(outer_normal(shape, {0, 1, 0}), Vec3{});
}

TEST(DiscExtent, IsTheBoxOfADisc) {
  const Vec3 extent = disc_extent({0, 1, 0}, 2.0);
  EXPECT_DOUBLE_EQ(extent.x, 2.0);
  EXPECT_DOUBLE_EQ(extent.y, 0.0);
  EXPECT_DOUBLE_EQ(extent.z, 2.0);
}

}  // namespace
}  // namespace lenticule::render
