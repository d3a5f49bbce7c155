// SPDX-License-Identifier: Apache-2.0
#include "render/shading/environment_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "render/scene/surroundings.h"
#include "render/shading/pbr_scene.h"
#include "tests/support/oracles/pbr_oracle.h"

namespace lenticule::render {
namespace {

using test::hemisphere_integral;

Vec3 studio(Vec3 direction, double) { return Vec3{1, 1, 1} * studio_light(direction); }

/// Returns the mean of the light over the lobe of a surface seen from straight ahead.
double lobe_mean(Vec3 ahead, double roughness) {
  const double alpha = roughness * roughness;
  const Vec3 both = hemisphere_integral(ahead, 400, [&](Vec3 light) {
    const Vec3 half = normalized(ahead + light);
    const double z = dot(ahead, half), cosine = dot(ahead, light);
    const double weight =
        ggx_distribution({std::sqrt(std::max(0.0, 1.0 - z * z)), 0.0, z}, alpha, alpha) * cosine;
    return Vec3{studio_light(light) * weight, weight, 0.0};
  });
  return both.x / both.y;
}

TEST(EnvironmentLight, OfOneLightEverywhereIsThatLight) {
  const EnvironmentLight light([](Vec3, double) { return Vec3{0.5, 1.0, 2.0}; });
  for (const Vec3 d : {Vec3{0, 0, 1}, Vec3{0, 1, 0}, normalized(Vec3{1, -2, 0.3})}) {
    for (const double roughness : {0.0, 0.05, 0.3, 1.0}) {
      EXPECT_NEAR(light.mirrored(d, roughness).x, 0.5, 1e-5);
      EXPECT_NEAR(light.mirrored(d, roughness).z, 2.0, 1e-5);
    }
    EXPECT_NEAR(light.diffuse(d).y, 1.0, 1e-5);
  }
}

TEST(EnvironmentLight, IsFilteredByTheLobeOfTheRoughness) {
  const EnvironmentLight light(studio);
  for (const Vec3 d : {Vec3{0, 0, 1}, Vec3{0, 1, 0}, normalized(Vec3{-0.62, 0.45, 0.64}),
                       normalized(Vec3{0.3, -0.4, -0.8}), normalized(Vec3{-0.2, 0.3, 0.8})})
    for (const double roughness : {0.375, 0.625, 1.0}) {
      const double wanted = lobe_mean(d, roughness);
      EXPECT_NEAR(light.mirrored(d, roughness).x, wanted, 0.05 * wanted)
          << d.x << ' ' << d.y << ' ' << d.z << ", roughness " << roughness;
    }
}

TEST(EnvironmentLight, OfAMirrorIsTheSource) {
  const EnvironmentLight light(studio);
  const Vec3 d = normalized(Vec3{0.8, 0.1, 0.6});
  EXPECT_EQ(light.mirrored(d, 0.0).x, studio_light(d));
}

TEST(EnvironmentLight, OfAMattSurfaceIsTheCosineMean) {
  const EnvironmentLight light(studio);
  for (const Vec3 n : {Vec3{0, 0, 1}, Vec3{0, -1, 0}, normalized(Vec3{1, 1, 1})}) {
    const Vec3 wanted = hemisphere_integral(n, 400, [&](Vec3 d) {
      return Vec3{1, 1, 1} * (studio_light(d) * dot(n, d) / std::numbers::pi);
    });
    EXPECT_NEAR(light.diffuse(n).x, wanted.x, 0.02 * wanted.x);
  }
}

TEST(StudioLight, LightsAWhiteMattSurfaceThatFacesTheViewerWithOne) {
  const Vec3 light = hemisphere_integral({0, 0, 1}, 400, [](Vec3 d) {
    return Vec3{1, 1, 1} * (studio_light(d) * d.z / std::numbers::pi);
  });
  EXPECT_NEAR(light.x, 1.0, 0.01);
}

}  // namespace
}  // namespace lenticule::render
