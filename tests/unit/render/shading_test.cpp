// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/oracles/whitted_light.h"

namespace lenticule::render {
namespace {

using test::reflected_light;

constexpr Vec3 kUp{0, 1, 0};

Material material(double diffuse, double specular, double shine) {
  Material m;
  m.diffuse = diffuse;
  m.specular = specular;
  m.shine = shine;
  return m;
}

Surface facing_up(const Material& m) {
  Surface surface;
  surface.geometric_normal = kUp;
  surface.shading_normal = kUp;
  surface.material = &m;
  return surface;
}

Vec3 slanted(double degrees) {
  const double a = degrees * std::numbers::pi / 180.0;
  return {std::sin(a), std::cos(a), 0.0};
}

TEST(ReflectedLight, FollowsLambertsCosine) {
  const Material m = material(0.8, 0.0, 1.0);
  const Surface surface = facing_up(m);
  for (const double degrees : {0.0, 30.0, 60.0, 89.0}) {
    const Arrival light{.toward_light = slanted(degrees), .distance = 5.0, .intensity = 2.0};
    EXPECT_NEAR(reflected_light(surface, -kUp, light), 1.6 * slanted(degrees).y, 1e-12);
  }
}

TEST(ReflectedLight, IsZeroBehindEitherNormal) {
  const Material m = material(1.0, 1.0, 2.0);
  Surface surface = facing_up(m);
  const Arrival light{.toward_light = slanted(80.0), .distance = 1.0, .intensity = 1.0};
  EXPECT_GT(reflected_light(surface, -kUp, light), 0.0);
  surface.shading_normal = slanted(-15.0);
  EXPECT_EQ(reflected_light(surface, -kUp, light), 0.0);
  surface.shading_normal = kUp;
  surface.geometric_normal = slanted(-15.0);
  EXPECT_EQ(reflected_light(surface, -kUp, light), 0.0);
}

TEST(ReflectedLight, HighlightIsBrightestInTheMirrorDirection) {
  const Material m = material(0.0, 0.5, 20.0);
  const Surface surface = facing_up(m);
  const Arrival light{.toward_light = slanted(40.0), .distance = 1.0, .intensity = 1.0};
  EXPECT_NEAR(reflected_light(surface, -slanted(-40.0), light), 0.5, 1e-12);
  EXPECT_NEAR(reflected_light(surface, -slanted(-30.0), light),
              0.5 * std::pow(std::cos(10.0 * std::numbers::pi / 180.0), 20.0), 1e-12);
}

TEST(Arrival, FallsOffWithTheSquareOfTheDistanceInWorldUnits) {
  SceneLight light;
  light.position = {0, 30, 0};
  light.colour = {9, 9, 9};
  EXPECT_DOUBLE_EQ(arrival(light, {}, 10.0, 0).intensity, 9.0);
  light.falls_off = true;
  EXPECT_DOUBLE_EQ(arrival(light, {}, 10.0, 0).intensity, 1.0);
}

TEST(Arrival, OfASunIsConstant) {
  SceneLight light;
  light.kind = Light::Kind::Directional;
  light.direction = {0, -1, 0};
  light.colour = {0.3, 0.4, 0.5};
  const Arrival here = arrival(light, {1e6, 2, 3}, 1.0, 2);
  EXPECT_EQ(here.toward_light, kUp);
  EXPECT_EQ(here.intensity, 0.5);
  EXPECT_EQ(here.distance, std::numeric_limits<double>::infinity());
}

TEST(Arrival, OfASpotEndsAtItsOuterCone) {
  SceneLight light;
  light.kind = Light::Kind::Spot;
  light.position = {0, 10, 0};
  light.direction = {0, -1, 0};
  light.colour = {1, 1, 1};
  light.cos_inner = std::cos(0.2);
  light.cos_outer = std::cos(0.4);
  const auto at_angle = [&](double angle) {
    return arrival(light, {10.0 * std::tan(angle), 0, 0}, 1.0, 0).intensity;
  };
  EXPECT_DOUBLE_EQ(at_angle(0.0), 1.0);
  EXPECT_DOUBLE_EQ(at_angle(0.19), 1.0);
  EXPECT_GT(at_angle(0.3), 0.0);
  EXPECT_LT(at_angle(0.3), 1.0);
  EXPECT_EQ(at_angle(0.41), 0.0);
}

TEST(Arrival, AtTheLightItselfIsZero) {
  SceneLight light;
  light.falls_off = true;
  EXPECT_EQ(arrival(light, light.position, 1.0, 0).intensity, 0.0);
}

TEST(Continuation, MirrorsAboutTheNormal) {
  const Material m = material(0.5, 0.3, 5.0);
  const Continuation on = continuation(facing_up(m), -slanted(35.0));
  EXPECT_EQ(on.mirror_weight, 0.3);
  EXPECT_EQ(on.transmit_weight, 0.0);
  EXPECT_NEAR(length(on.mirror_direction - slanted(-35.0)), 0.0, 1e-12);
}

TEST(Continuation, NeverMirrorsIntoTheSurface) {
  const Material m = material(0.5, 0.3, 5.0);
  Surface surface = facing_up(m);
  surface.shading_normal = slanted(-40.0);
  const Vec3 grazing = -slanted(80.0);
  EXPECT_GT(dot(continuation(surface, grazing).mirror_direction, surface.geometric_normal), 0.0);
}

TEST(Continuation, BendsBySnellsLawAndBack) {
  Material m;
  m.transmittance = 0.9;
  m.refraction_index = 1.5;
  Surface surface = facing_up(m);
  surface.colour = 0.5;
  const Continuation in = continuation(surface, -slanted(40.0));
  EXPECT_NEAR(in.transmit_weight, 0.45, 1e-12);
  EXPECT_NEAR(-in.transmit_direction.x, std::sin(40.0 * std::numbers::pi / 180.0) / 1.5, 1e-12);
  surface.outer_side = false;
  const Continuation out = continuation(surface, in.transmit_direction);
  EXPECT_NEAR(length(out.transmit_direction + slanted(40.0)), 0.0, 1e-12);
}

TEST(Continuation, ReflectsTotallyBeyondTheCriticalAngle) {
  Material m;
  m.transmittance = 0.9;
  m.specular = 0.1;
  m.refraction_index = 1.5;
  Surface surface = facing_up(m);
  surface.outer_side = false;
  const Continuation inside =
      continuation(surface, -slanted(42.0));  // critical angle: 41.8 degrees
  EXPECT_EQ(inside.transmit_weight, 0.0);
  EXPECT_NEAR(inside.mirror_weight, 1.0, 1e-12);
  EXPECT_GT(continuation(surface, -slanted(41.7)).transmit_weight, 0.0);
}

TEST(Continuation, AtTheCriticalAngleStaysFinite) {
  Material m;
  m.transmittance = 1.0;
  m.refraction_index = 1.5;
  Surface surface = facing_up(m);
  surface.outer_side = false;
  const double critical = std::asin(1.0 / 1.5);
  const Continuation on = continuation(surface, {-std::sin(critical), -std::cos(critical), 0});
  EXPECT_TRUE(is_finite(on.transmit_direction));
  EXPECT_TRUE(is_finite(on.mirror_direction));
}

TEST(Continuation, GoesStraightThroughAnIndexOfOne) {
  Material m;
  m.transmittance = 1.0;
  const Vec3 direction = -slanted(70.0);
  EXPECT_EQ(continuation(facing_up(m), direction).transmit_direction, direction);
}

}  // namespace
}  // namespace lenticule::render
