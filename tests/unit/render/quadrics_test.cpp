// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "render/accel/primitives.h"

namespace lenticule::render {
namespace {

TEST(QuadraticRoots, KeepTheSmallRootWithoutCancellation) {
  // t^2 - 2e8 t + 1: the small root is 5e-9, of which the textbook formula keeps no digit.
  const Roots roots = quadratic_roots(1.0, -1e8, 1.0);
  ASSERT_EQ(roots.count, 2);
  EXPECT_NEAR(roots.t[0], 5e-9, 1e-21);
}

TEST(QuadraticRoots, AreNoneForNonFiniteCoefficients) {
  EXPECT_EQ(quadratic_roots(1.0, std::nan(""), 1.0).count, 0);
  EXPECT_EQ(quadratic_roots(1.0, 0.0, 1.0).count, 0);
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

TEST(Cone, HasNoNormalOnItsAxis) {
  const ConeShape shape{
      .base = {0, 0, 0}, .axis = {0, 1, 0}, .height = 1.0, .base_radius = 1.0, .slope = -1.0};
  EXPECT_EQ(outer_normal(shape, {0, 1, 0}), Vec3{});
}

}  // namespace
}  // namespace lenticule::render
