// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "base/error.h"
#include "render/scene/surroundings.h"
#include "tests/support/oracles/pbr_oracle.h"

namespace lenticule::render {
namespace {

void expect_near(Vec3 a, Vec3 b, double within) {
  EXPECT_NEAR(a.x, b.x, within);
  EXPECT_NEAR(a.y, b.y, within);
  EXPECT_NEAR(a.z, b.z, within);
}

TEST(ToneMap, PbrNeutralIsKhronosFormula) {
  std::mt19937 generator(3);
  std::exponential_distribution<double> light(0.7);
  for (int n = 0; n < 2000; ++n) {
    const Vec3 c{light(generator), light(generator), light(generator)};
    expect_near(tone_mapped(ToneMap::PbrNeutral, c), test::oracle_pbr_neutral(c), 1e-12);
  }
  // Base colours up to 0.8 lose only the reflection of a dielectric.
  expect_near(tone_mapped(ToneMap::PbrNeutral, {0.6, 0.4, 0.3}), {0.56, 0.36, 0.26}, 1e-12);
}

TEST(ToneMap, AcesMapsGreysToTheValuesOfItsFit) {
  expect_near(tone_mapped(ToneMap::Aces, {}), {}, 1e-3);
  // (v^2 + a v - b) / (c v^2 + d v + e) at v = 0.18 / 0.6; both matrices keep greys.
  const double v = 0.3;
  const double grey =
      (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081);
  expect_near(tone_mapped(ToneMap::Aces, {0.18, 0.18, 0.18}), {grey, grey, grey}, 1e-4);
  expect_near(tone_mapped(ToneMap::Aces, {1e6, 1e6, 1e6}), {1, 1, 1}, 1e-12);
}

TEST(ToneMap, NoneChangesNothing) {
  EXPECT_EQ(tone_mapped(ToneMap::None, {0.3, 2.0, 0.0}), (Vec3{0.3, 2.0, 0.0}));
}

TEST(ToneMap, NeitherBrightensGreysNorMapsThemBeyondOne) {
  for (const ToneMap map : {ToneMap::PbrNeutral, ToneMap::Aces}) {
    double last = -1.0;
    for (double light = 0.01; light < 1e4; light *= 1.1) {
      const double shown = tone_mapped(map, {light, light, light}).y;
      EXPECT_GT(shown, last - 1e-12);
      EXPECT_LE(shown, 1.0);
      last = shown;
    }
  }
}

TEST(ToneMap, IsNamed) {
  EXPECT_EQ(tone_map_named("none"), ToneMap::None);
  EXPECT_EQ(tone_map_named("pbr-neutral"), ToneMap::PbrNeutral);
  EXPECT_EQ(tone_map_named("aces"), ToneMap::Aces);
  EXPECT_THROW((void)tone_map_named("filmic"), Error);
}

}  // namespace
}  // namespace lenticule::render
