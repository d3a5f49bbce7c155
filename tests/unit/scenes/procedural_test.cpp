// SPDX-License-Identifier: Apache-2.0
// Tests the primitive counts of each generator against formulas, and that closed shapes are closed.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <sstream>

#include "scenes/scene_list.h"

namespace lenticule::scenes {
namespace {

SceneCounts counts(const char* name, int size) {
  return build_scene(find_scene(name), size).counts;
}

TEST(SmallBallsScene, ContainsASphereflakeAndAGlassBall) {
  for (const auto& [size, spheres] : {std::pair{1, 10}, {2, 91}, {3, 820}})
    EXPECT_EQ(counts("small-balls", size).spheres, spheres + 1);
}

TEST(GearsScene, EveryGearIsTwelveQuadsPerTooth) {
  for (const int n : {1, 2, 4}) EXPECT_EQ(counts("gears", n).polygons, n * n * n * 24 * 12 + 2);
}

TEST(PrimitivesScene, HasEveryKindAtEverySize) {
  for (const int n : {1, 2, 8}) {
    const SceneCounts all = counts("primitives", n);
    EXPECT_EQ(all.spheres, 2);
    EXPECT_EQ(all.cones, 3);
    const int marble = 16 * n * (4 * n - 1);
    const int ring = 2 * 8 * n * 4 * n;
    const int lids = 2;
    const int box_and_floor = 12 + 2;
    const int pointed = 4 + 8;
    EXPECT_EQ(all.polygons, marble + ring + lids + box_and_floor + pointed);
  }
}

TEST(RoomScene, HasItsFurnitureAtEverySize) {
  for (const int n : {2, 6}) {
    const SceneCounts all = counts("room", n);
    EXPECT_EQ(all.spheres, 3);
    EXPECT_EQ(all.cones, 2 + 4 * 2);
    const int teapot = 64 * n * n - 8 * n;
    const int marble = 16 * n * (4 * n - 1);
    const int boxes = 12 * (1 + 5);  // mirror frame, table top and legs
    const int boards = 2 * 4;        // floor, bricks, rug, painting
    const int plain = 4 + 1 + 1;     // walls and ceiling, mirror, painting's frame
    EXPECT_EQ(all.polygons, teapot + marble + boxes + boards + plain);
  }
}

TEST(PaperScenes, HaveThePapersFrames) {
  const std::map<std::string, int> frames = {{"teapot", 612},      {"room", 634},
                                             {"small-balls", 421}, {"primitives", 512},
                                             {"tree", 612},        {"gears", 612}};
  for (const auto& [name, count] : frames) {
    EXPECT_EQ(find_scene(name).frames, count) << name;
    EXPECT_TRUE(find_scene(name).only_camera_moves) << name;
  }
}

// ---- polygons as a simple reader triangulates them

using Polygon = std::vector<Vec3>;

std::vector<Polygon> plain_polygons(const std::string& nff) {
  std::istringstream in(nff);
  std::vector<Polygon> polygons;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string keyword;
    size_t corners = 0;
    if (!(words >> keyword >> corners) || keyword != "p") continue;
    Polygon polygon(corners);
    for (Vec3& p : polygon) in >> p.x >> p.y >> p.z;
    polygons.push_back(polygon);
  }
  return polygons;
}

TEST(EveryScene, WritesConvexFlatPolygonsOnly) {
  for (const BuiltInScene& scene : scene_list()) {
    for (const Polygon& p : plain_polygons(write_scene(scene, 2))) {
      const size_t n = p.size();
      Vec3 area{};
      for (size_t i = 1; i + 1 < n; ++i) area += cross(p[i] - p[0], p[i + 1] - p[0]);
      const double size = std::sqrt(length(area));
      const Vec3 normal = normalized(area);
      for (size_t i = 0; i < n; ++i) {
        const Vec3 turn = cross(p[(i + 1) % n] - p[i], p[(i + 2) % n] - p[(i + 1) % n]);
        ASSERT_GT(dot(turn, normal), -1e-6 * size * size) << scene.name;
        ASSERT_NEAR(dot(p[i] - p[0], normal), 0.0, 1e-6 * size) << scene.name;
      }
    }
  }
}

/// Returns a corner in millionths, so that equal text gives equal keys.
std::array<long, 3> key(Vec3 p) {
  return {std::lround(p.x * 1e6), std::lround(p.y * 1e6), std::lround(p.z * 1e6)};
}

/// Returns the number of edges that no polygon uses in the opposite direction.
int open_edges(const std::vector<Polygon>& polygons) {
  std::map<std::pair<std::array<long, 3>, std::array<long, 3>>, int> edges;
  for (const Polygon& p : polygons)
    for (size_t i = 0; i < p.size(); ++i) ++edges[{key(p[i]), key(p[(i + 1) % p.size()])}];
  int open = 0;
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    open += back == edges.end() ? count : std::max(0, count - back->second);
  }
  return open;
}

double volume(const std::vector<Polygon>& polygons) {
  double six = 0.0;
  for (const Polygon& p : polygons)
    for (size_t i = 1; i + 1 < p.size(); ++i) six += dot(p[0], cross(p[i], p[i + 1]));
  return six / 6.0;
}

TEST(GearsScene, AGearIsClosedAndFacesOutward) {
  std::vector<Polygon> polygons = plain_polygons(write_scene(find_scene("gears"), 1));
  std::erase_if(polygons, [](const Polygon& p) { return p.size() == 3; });  // removes the table
  EXPECT_EQ(open_edges(polygons), 0);
  // A disc of the pitch radius with its hole: teeth and gaps have about equal volume.
  EXPECT_NEAR(volume(polygons), 3.1416 * (0.25 - 0.04) * 0.28, 0.01);
}

// ---- pictures

TEST(Pictures, AreCodeValuesAndContinueAtTheRepeat) {
  for (const SharedPicture& picture :
       {checker_picture(), marble_picture(), wood_picture(), brick_picture(), weave_picture()}) {
    ASSERT_EQ(picture->rgb.size(), 3U * picture->width * picture->height) << picture->name;
    for (const float value : picture->rgb) ASSERT_TRUE(value >= 0.0F && value <= 1.0F);
    // Across the edge from right to left, texels differ no more than inside.
    const auto red = [&](int column, int row) {
      return picture->rgb[3 * static_cast<size_t>(row * picture->width + column)];
    };
    float seam = 0.0F;
    float within = 0.0F;
    for (int row = 0; row < picture->height; ++row) {
      seam += std::abs(red(0, row) - red(picture->width - 1, row));
      for (int column = 1; column < picture->width; ++column)
        within = std::max(within, std::abs(red(column, row) - red(column - 1, row)));
    }
    EXPECT_LE(seam / static_cast<float>(picture->height), within + 1e-6F) << picture->name;
  }
}

// ---- the two forms of a scene

TEST(SceneParts, PlainTextHasTheSameCountsAndNamesMissingParts) {
  for (const BuiltInScene& scene : scene_list()) {
    const SceneParts kept = build_scene(scene, 2);
    const SceneParts plain = build_scene(scene, 2, 0, Pictures::Plain);
    EXPECT_EQ(kept.counts.primitives(), plain.counts.primitives()) << scene.name;
    EXPECT_EQ(kept.counts.lights, plain.counts.lights) << scene.name;
    EXPECT_TRUE(plain.pictured.empty());
    EXPECT_EQ(nff_text(plain).find("NFF has no pictures") != std::string::npos,
              !kept.pictured.empty());
  }
}

TEST(SceneParts, CommentsComeLastForReadersThatStopAtOne) {
  for (const BuiltInScene& scene : scene_list()) {
    std::istringstream in(write_scene(scene, 2));
    bool comment_seen = false;
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with('#')) comment_seen = true;
      EXPECT_TRUE(!comment_seen || line.starts_with('#')) << scene.name << ": " << line;
    }
    EXPECT_TRUE(comment_seen);
  }
}

}  // namespace
}  // namespace lenticule::scenes
