// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace lenticule::render {
namespace {

constexpr Vec3 kUp{0, 1, 0};

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

TEST(Arrival, AtTheLightItselfIsZero) {
  SceneLight light;
  light.falls_off = true;
  EXPECT_EQ(arrival(light, light.position, 1.0, 0).intensity, 0.0);
}

TEST(Continuation, NeverMirrorsIntoTheSurface) {
  const Material m{.specular = 0.3};
  Surface surface = facing_up(m);
  surface.shading_normal = slanted(-40.0);
  const Vec3 grazing = -slanted(80.0);
  EXPECT_GT(dot(continuation(surface, grazing).mirror_direction, surface.geometric_normal), 0.0);
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

}  // namespace
}  // namespace lenticule::render
