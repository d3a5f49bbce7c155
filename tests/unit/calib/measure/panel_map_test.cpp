// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/panel_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace lenticule::calib {
namespace {

/// Returns the panel point of a camera at the side, with barrel distortion, over a 4K panel.
Vec2 seen_point(Vec2 camera) {
  const double x = (camera.x - 980.0) / 1400.0, y = (camera.y - 530.0) / 1400.0;
  const double r2 = x * x + y * y;
  const double u = x * (1.0 + 0.04 * r2), v = y * (1.0 + 0.04 * r2);
  const double w = 1.0 + 0.3 * u - 0.05 * v;
  return {1900.0 + 4400.0 * u / w, 1100.0 + (4300.0 * v + 100.0 * u) / w};
}

std::vector<Sighting> sightings(double noise, double wrong_part) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, noise);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<Sighting> all;
  for (double y = 150.0; y < 900.0; y += 24.0)
    for (double x = 350.0; x < 1600.0; x += 24.0) {
      Vec2 panel = seen_point({x, y}) + Vec2{normal(random), normal(random)};
      if (share(random) < wrong_part) panel.x += 500.0 * (share(random) - 0.5);
      all.push_back({.camera_px = {x, y}, .panel_px = panel});
    }
  return all;
}

double worst_error(const PanelMap& map) {
  double worst = 0.0;
  for (double y = 160.0; y < 890.0; y += 31.0)
    for (double x = 360.0; x < 1590.0; x += 31.0) {
      const Vec2 off = map.at({x, y}) - seen_point({x, y});
      worst = std::max(worst, std::hypot(off.x, off.y));
    }
  return worst;
}

TEST(PanelMap, FollowsADistortingCameraFromTheSide) {
  const std::optional<PanelMap> map = PanelMap::fit(sightings(0.0, 0.0));
  ASSERT_TRUE(map);
  EXPECT_LT(worst_error(*map), 0.2);
}

TEST(PanelMap, ToleratesWrongSightings) {
  const std::optional<PanelMap> map = PanelMap::fit(sightings(0.5, 0.1));
  ASSERT_TRUE(map);
  EXPECT_LT(worst_error(*map), 0.6);
  EXPECT_NEAR(map->typical_error_px(), 0.6, 0.3);
}

TEST(PanelMap, RefusesPointsOnALine) {
  std::vector<Sighting> line;
  for (int i = 0; i < 100; ++i)
    line.push_back({.camera_px = {10.0 * i, 20.0 * i}, .panel_px = {30.0 * i, 7.0 * i}});
  EXPECT_FALSE(PanelMap::fit(line));
  EXPECT_FALSE(PanelMap::fit({}));
}

TEST(Homography, MapsItsOwnPointsExactly) {
  std::vector<Sighting> four;
  for (const Vec2 p : {Vec2{0, 0}, Vec2{100, 0}, Vec2{100, 80}, Vec2{0, 80}})
    four.push_back({.camera_px = p,
                    .panel_px = {(3.0 * p.x + 5.0) / (1.0 + 0.001 * p.x),
                                 (2.0 * p.y + 0.1 * p.x) / (1.0 + 0.001 * p.x)}});
  const std::optional<Homography> h = fit_homography(four);
  ASSERT_TRUE(h);
  for (const Sighting& s : four) {
    const Vec2 p = map_through(*h, s.camera_px);
    EXPECT_NEAR(p.x, s.panel_px.x, 1e-8);
    EXPECT_NEAR(p.y, s.panel_px.y, 1e-8);
  }
}

}  // namespace
}  // namespace lenticule::calib
