// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "render/shading/pbr_scene.h"
#include "tests/support/oracles/pbr_oracle.h"

namespace lenticule::render {
namespace {

using test::hemisphere_integral;

class Random {
 public:
  double number(double low = 0.0, double high = 1.0) {
    return std::uniform_real_distribution<double>(low, high)(generator_);
  }
  Vec3 colour() { return {number(), number(), number()}; }
  /// Returns a direction with a cosine of at least `least` to `axis`.
  Vec3 direction(Vec3 axis, double least) {
    for (;;) {
      const Vec3 d = normalized(Vec3{number(-1, 1), number(-1, 1), number(-1, 1)});
      if (dot(d, axis) > least) return d;
    }
  }

 private:
  std::mt19937 generator_{7};
};

Vec3 perpendicular(Vec3 n) {
  return normalized(cross(n, std::abs(n.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
}

PbrPoint plain_point(Vec3 view, double roughness, double metallic) {
  PbrPoint point;
  point.view = view;
  point.geometric = point.normal = point.coat_normal = {0, 0, 1};
  point.tangent = {1, 0, 0};
  point.roughness = roughness;
  point.metallic = metallic;
  return point;
}

Vec3 view_at(double cosine) { return {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}; }

/// A material of random layers.
PbrPoint random_point(Random& random) {
  PbrPoint point;
  point.geometric = random.direction({0, 0, 1}, -1.0);
  point.normal = random.direction(point.geometric, 0.9);
  point.coat_normal = random.direction(point.geometric, 0.95);
  point.view = random.direction(point.normal, 0.15);
  while (dot(point.view, point.coat_normal) < 0.1)
    point.view = random.direction(point.normal, 0.15);
  point.tangent = perpendicular(point.normal);
  point.colour = random.colour();
  point.metallic = random.number() < 0.3 ? 0.0 : random.number();
  point.roughness = random.number(0.12, 1.0);
  point.ior = random.number(1.0, 2.2);
  point.specular = random.number();
  point.specular_colour = random.colour();
  if (random.number() < 0.4) {
    point.clearcoat = random.number();
    point.clearcoat_roughness = random.number(0.1, 1.0);
  }
  if (random.number() < 0.3) {
    point.sheen_colour = random.colour();
    point.sheen_roughness = random.number(0.2, 1.0);
  }
  if (random.number() < 0.3) point.transmission = random.number();
  return point;
}

TEST(PbrShading, AgreesWithTheReferenceForRandomMaterialsAndLights) {
  Random random;
  for (int n = 0; n < 150; ++n) {
    const PbrPoint point = random_point(random);
    const Vec3 light = random.direction(point.geometric, -0.3);
    const Vec3 found = PbrShader(point).of_light(light);
    const Vec3 wanted = test::oracle_of_light(point, light);
    for (const auto& [a, b] :
         {std::pair{found.x, wanted.x}, std::pair{found.y, wanted.y}, std::pair{found.z, wanted.z}})
      EXPECT_NEAR(a, b, 0.004 + 0.012 * b) << "material " << n;
  }
}

TEST(PbrShading, AgreesWithTheReferenceForAnisotropicSurfaces) {
  Random random;
  for (int n = 0; n < 50; ++n) {
    PbrPoint point = random_point(random);
    point.anisotropy = random.number();
    const Vec3 light = random.direction(point.normal, 0.05);
    const Vec3 found = PbrShader(point).of_light(light);
    const Vec3 wanted = test::oracle_of_light(point, light);
    EXPECT_NEAR(found.y, wanted.y, 0.004 + 0.012 * wanted.y) << "material " << n;
  }
}

TEST(PbrShading, LooksUpAlbedosWithinTheStatedErrors) {
  Random random;
  for (int n = 0; n < 60; ++n) {
    const double cosine = random.number(0.03, 1.0), roughness = random.number(0.08, 1.0);
    const GgxAlbedo albedo = ggx_albedo(cosine, roughness);
    EXPECT_NEAR(albedo.scale + albedo.bias, test::oracle_ggx_albedo(cosine, roughness, 1, 1), 0.004)
        << cosine << ' ' << roughness;
    EXPECT_NEAR(albedo.bias, test::oracle_ggx_albedo(cosine, roughness, 0, 1), 0.004);
    EXPECT_NEAR(sheen_albedo(cosine, roughness),
                std::min(1.0, test::oracle_sheen_albedo(cosine, roughness)), 0.01)
        << cosine << ' ' << roughness;
  }
}

/// The projected area of all microfacets is that of the surface.
TEST(PbrShading, NormalisesTheDensityOfMicrofacets) {
  for (const auto& [t, b] : {std::pair{0.2, 0.2}, std::pair{0.6, 0.3}, std::pair{1.0, 1.0}}) {
    const Vec3 area = hemisphere_integral({0, 0, 1}, 600, [&, t = t, b = b](Vec3 h) {
      return Vec3{1, 1, 1} * (ggx_distribution(h, t, b) * h.z);
    });
    EXPECT_NEAR(area.x, 1.0, 0.002) << t << ' ' << b;
  }
  for (const double alpha : {0.05, 0.3, 1.0}) {
    const Vec3 area = hemisphere_integral({0, 0, 1}, 600, [&](Vec3 h) {
      return Vec3{1, 1, 1} * (charlie_distribution(h.z, alpha) * h.z);
    });
    EXPECT_NEAR(area.x, 1.0, 0.002) << alpha;
  }
}

/// White furnace: a white surface in white light is invisible.
TEST(PbrShading, ReflectsAllOfUniformLight) {
  const EnvironmentLight white(Vec3{1, 1, 1});
  for (const double metallic : {0.0, 0.5, 1.0})
    for (const double roughness : {0.0, 0.1, 0.4, 0.8, 1.0})
      for (const double cosine : {0.05, 0.3, 0.7, 1.0}) {
        const PbrShader shader(plain_point(view_at(cosine), roughness, metallic));
        const Vec3 light = shader.of_environment(white, {});
        EXPECT_NEAR(light.x, 1.0, 1e-9) << metallic << ' ' << roughness << ' ' << cosine;
      }
}

/// Lights all around a surface give what the environment gives, to one percent.
TEST(PbrShading, ReflectsAsMuchOfLightsAsOfTheEnvironment) {
  for (const double metallic : {0.0, 1.0})
    for (const double roughness : {0.3, 0.6, 1.0})
      for (const double cosine : {0.2, 0.6, 1.0}) {
        const PbrShader shader(plain_point(view_at(cosine), roughness, metallic));
        const Vec3 light = hemisphere_integral(
            {0, 0, 1}, 300, [&](Vec3 l) { return shader.of_light(l) / std::numbers::pi; });
        EXPECT_NEAR(light.x, 1.0, 0.01) << metallic << ' ' << roughness << ' ' << cosine;
      }
}

TEST(PbrShading, NeverReflectsMoreThanArrives) {
  const EnvironmentLight white(Vec3{1, 1, 1});
  Random random;
  for (int n = 0; n < 3000; ++n) {
    PbrPoint point = random_point(random);
    point.anisotropy = random.number();
    if (random.number() < 0.3) {
      point.iridescence = random.number();
      point.iridescence_nm = random.number(0.0, 900.0);
    }
    point.roughness = random.number();
    const PbrShader shader(point);
    const Vec3 light = shader.of_environment(white, {}) + shader.transmitted();
    for (const double v : {light.x, light.y, light.z}) {
      EXPECT_LE(v, 1.0 + 1e-9);
      EXPECT_GE(v, 0.0);
    }
  }
}

TEST(PbrShading, ReflectsNothingOfLightsBehindTheSurface) {
  Random random;
  for (int n = 0; n < 200; ++n) {
    const PbrPoint point = random_point(random);
    EXPECT_EQ(PbrShader(point).of_light(random.direction(-point.geometric, 0.0)), Vec3{});
  }
}

/// A film of no thickness has next to no colour; thicker ones have.
TEST(PbrShading, ThinFilmsTintReflections) {
  const Vec3 base{0.04, 0.04, 0.04};
  const Vec3 none = film_f0(1.3, 0.9, 0.0, base);
  EXPECT_NEAR(none.x, 0.04, 0.01);
  EXPECT_NEAR(none.y, none.x, 0.003);
  const Vec3 thick = film_f0(1.8, 0.9, 400.0, base);
  EXPECT_GT(std::abs(thick.x - thick.y) + std::abs(thick.y - thick.z), 0.02);
}

TEST(PbrShading, OcclusionDarkensTheEnvironmentAndNotLights) {
  PbrPoint point = plain_point(view_at(0.8), 0.6, 0.0);
  const PbrShader open(point);
  point.occlusion = 0.5;
  const PbrShader occluded(point);
  const EnvironmentLight white(Vec3{1, 1, 1});
  EXPECT_LT(occluded.of_environment(white, {}).x, 0.6);
  EXPECT_EQ(occluded.of_light({0, 0, 1}), open.of_light({0, 0, 1}));
}

}  // namespace
}  // namespace lenticule::render
