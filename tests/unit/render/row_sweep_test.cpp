// SPDX-License-Identifier: Apache-2.0
// Tests the row sweep against every ray with every primitive, on rigs small enough for that.
#include "render/row_sweep/row_sweep.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <utility>

#include "apps/lenticule-bench/probes/row_tracer.h"
#include "render/methods/adaptive/key_grid.h"
#include "render/rays/primary_rays.h"
#include "tests/support/allocation_count.h"
#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"
#include "tests/support/visibility_oracle.h"

namespace lenticule::render {
namespace {

using testing::Evaluation;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct NamedRig {
  std::string name;
  optics::Rig rig;
};

std::vector<NamedRig> tiny_rigs() {
  std::vector<NamedRig> rigs = {
      {"slanted", testing::make_rig({})},
      {"upright", testing::make_rig({.pitch_subpx = 9.0, .slant = 0.0})},
      {"eye above", testing::make_rig({.eye_height_mm = 120.0})},
      {"parallel", testing::make_rig({.distance_mm = kInfinity, .eye_height_mm = -0.2})},
      {"leaning left", testing::make_rig({.pitch_subpx = 5.3, .slant = -0.7})},
      {"cells", testing::make_rig({.layout = "cells"})},
      {"wide lenses", testing::make_rig({.pitch_subpx = 31.4, .slant = 0.2})},
      {"narrow lenses", testing::make_rig({.pitch_subpx = 2.2, .slant = 0.2})},
      {"near eye", testing::make_rig({.distance_mm = 90.0})},
  };
  const auto add = [&](const char* name, auto change) {
    optics::Rig rig = testing::make_rig({});
    change(rig);
    rigs.push_back({name, rig});
  };
  add("bgr", [](optics::Rig& rig) { rig.panel.layout = optics::SubpixelLayout::bgr(); });
  add("vrgb", [](optics::Rig& rig) { rig.panel.layout = optics::SubpixelLayout::vrgb(); });
  add("nudged colours", [](optics::Rig& rig) {
    rig.sheet.channel_offset = {Subpixels(-0.2), Subpixels(0.0), Subpixels(0.3)};
  });
  add("residual", [](optics::Rig& rig) {
    std::mt19937_64 random(5);
    rig.sheet.residual = test::random_residual(random, 2, 2, 0.04);
  });
  return rigs;
}

struct Counts {
  int right = 0, close = 0, wrong = 0, seen = 0;
};

testing::SeenSurface surface_of(const SweptRow& row, size_t s) {
  if (row.cut[s] == SweptRow::kNothing) return {};
  const SweptCut& cut = row.cuts[static_cast<size_t>(row.cut[s])];
  return {false, cut.geometry, cut.primitive, row.z_mm[s]};
}

void count_row(const optics::OpticalModel& model, const Scene& scene, int j, const SweptRow& row,
               Counts& counts) {
  const double start = primary_start_mm(scene.near_mm, model.rig().viewing.distance.value);
  for (int s = 0; s < 3 * model.rig().panel.width_px; ++s) {
    const auto hits =
        testing::oracle_hits(scene, testing::oracle_ray(model, s / 3, j, s % 3), start);
    const testing::SeenSurface seen = surface_of(row, static_cast<size_t>(s));
    const Evaluation evaluation = evaluate(hits, seen);
    counts.right += evaluation == Evaluation::Right ? 1 : 0;
    counts.close += evaluation == Evaluation::Close ? 1 : 0;
    counts.wrong += evaluation == Evaluation::Wrong ? 1 : 0;
    counts.seen += seen.nothing ? 0 : 1;
    if (evaluation == Evaluation::Wrong)
      ADD_FAILURE() << "row " << j << " subpixel " << s << ": sees "
                    << (seen.nothing ? "nothing" : std::to_string(seen.geometry)) << " "
                    << seen.primitive << " at z " << seen.z_mm << " of " << hits.size()
                    << " candidates";
    if (counts.wrong > 10) return;
  }
}

Counts count_frame(const optics::Rig& rig, const SceneDescription& description,
                   const Stage& stage) {
  const optics::OpticalModel model(rig);
  const Scene scene(description, stage, {}, 1);
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  RowSweep::Worker worker(sweep);
  SweptRow row;
  Counts counts;
  for (int j = 0; j < rig.panel.height_px && counts.wrong <= 10; ++j) {
    worker.sweep(j, row);
    count_row(model, scene, j, row, counts);
  }
  return counts;
}

TEST(RowSweep, AgreesWithEveryRay) {
  Counts sum;
  for (const NamedRig& rig : tiny_rigs())
    for (const testing::NamedScene& scene : testing::tiny_scenes()) {
      SCOPED_TRACE(rig.name + ", " + scene.name);
      const Counts counts =
          count_frame(rig.rig, scene.scene, testing::make_tiny_stage({.turn_degrees = 7.0}));
      EXPECT_EQ(counts.wrong, 0);
      EXPECT_GT(counts.seen, 0);
      sum.right += counts.right;
      sum.close += counts.close;
    }
  EXPECT_LE(sum.close, sum.right / 10000) << sum.right;
}

TEST(RowSweep, FollowsTheStage) {
  const auto scenes = testing::tiny_scenes();
  const testing::TinyStage stages[] = {{.depth_scale = 0.2},
                                       {.centre = {0.5, -0.3, 2.5}, .turn_degrees = -40.0},
                                       {.mm_per_unit = 30.0, .depth_scale = 3.0},
                                       {.depth_scale = 0.5, .turn_degrees = 33.0}};
  for (const testing::TinyStage& stage : stages)
    for (const testing::NamedScene& scene : scenes) {
      SCOPED_TRACE(scene.name);
      const Counts counts =
          count_frame(testing::make_rig({}), scene.scene, testing::make_tiny_stage(stage));
      EXPECT_EQ(counts.wrong, 0);
      EXPECT_LE(counts.close, 1);
    }
}

TEST(RowSweep, OmitsGeometryOutsideTheStage) {
  Stage stage = testing::make_tiny_stage();
  stage.near_mm = -1.5;
  for (const testing::NamedScene& scene : testing::tiny_scenes()) {
    SCOPED_TRACE(scene.name);
    const Counts counts = count_frame(testing::make_rig({}), scene.scene, stage);
    EXPECT_EQ(counts.wrong, 0);
    EXPECT_LE(counts.close, 1);
  }
}

SceneDescription scene_of(std::vector<TriangleMesh> meshes) {
  SceneDescription scene;
  scene.materials = {Material{}};
  scene.meshes = std::move(meshes);
  return scene;
}
TriangleMesh triangle(Vec3 a, Vec3 b, Vec3 c) {
  TriangleMesh mesh;
  mesh.positions = {a, b, c};
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}
/// Returns a stage whose world units are millimetres of the panel.
Stage plain_stage() {
  return testing::make_tiny_stage({.mm_per_unit = 1.0});
}

TEST(RowSweep, ResolvesOutlinesOfEverySlope) {
  for (const NamedRig& rig : tiny_rigs()) {
    std::vector<TriangleMesh> spokes;
    for (int n = 0; n < 36; ++n) {
      const double a = n * 0.1745, b = a + 0.06;
      const double z = 20.0 * std::sin(5.0 * a);
      spokes.push_back(triangle({0.1, 0.2, z}, {40 * std::cos(a), 40 * std::sin(a), z + 9.0},
                                {40 * std::cos(b), 40 * std::sin(b), -z}));
    }
    SCOPED_TRACE(rig.name);
    const Counts counts = count_frame(rig.rig, scene_of(spokes), plain_stage());
    EXPECT_EQ(counts.wrong, 0);
    EXPECT_EQ(counts.close, 0);
    EXPECT_GT(counts.seen, 40);
  }
}

TEST(RowSweep, HandlesTrianglesThroughPanelEyeAndNearBound) {
  const TriangleMesh cases[] = {
      triangle({-50, -30, -400}, {60, -25, 300}, {5, 40, 20}),         // through the panel's plane
      triangle({-50, -30, -400}, {60, -25, 693}, {5, 40, 693}),        // touches the near bound
      triangle({-50, -30, -400}, {90, -25, 700}, {5, 40, 20}),         // touches the eye's plane
      triangle({-500, -30, -400}, {900, -250, 2000}, {-5, 400, 900}),  // continues behind the eye
      triangle({-50, 3, -100}, {60, -2500, 5000}, {5, 40, 900}),
      triangle({-20, -30, 650}, {20, -25, 640}, {5, 40, 660}),   // just in front of the eye
      triangle({-20, -30, 800}, {20, -25, 900}, {5, 40, 1000}),  // wholly behind the eye: not seen
  };
  for (const double distance : {700.0, kInfinity})
    for (size_t n = 0; n < std::size(cases); ++n) {
      SCOPED_TRACE(n);
      const Counts counts = count_frame(testing::make_rig({.distance_mm = distance}),
                                        scene_of({cases[n]}), plain_stage());
      EXPECT_EQ(counts.wrong, 0);
      EXPECT_EQ(counts.close, 0);
    }
}

TEST(RowSweep, ACoveringTriangleHidesTheRest) {
  const TriangleMesh wall = triangle({-1e5, -1e5, 1}, {1e5, -1e5, 2}, {0, 2e5, 0});
  SceneDescription scene = scene_of({wall, testing::box_mesh({-20, -20, -30}, {20, 20, -5}, 0)});
  for (const NamedRig& rig : tiny_rigs()) {
    SCOPED_TRACE(rig.name);
    const Counts counts = count_frame(rig.rig, scene, plain_stage());
    EXPECT_EQ(counts.wrong, 0);
    EXPECT_EQ(counts.seen, 3 * rig.rig.panel.width_px * rig.rig.panel.height_px);
  }
}

TEST(RowSweep, ReturnsNothingForAnEmptyScene) {
  const Counts counts = count_frame(testing::make_rig({}), scene_of({}), plain_stage());
  EXPECT_EQ(counts.seen, 0);
  EXPECT_EQ(counts.wrong, 0);
}

TEST(RowSweep, HandlesSliversAndTrianglesSeenEdgeOn) {
  const optics::OpticalModel model(testing::make_rig({}));
  std::vector<TriangleMesh> meshes;
  for (int n = 0; n < 24; ++n) {
    const double x = -28.0 + 2.4 * n;
    meshes.push_back(triangle({x, -20, 5}, {x + 1e-4, -20, 5}, {x + 3, 20, -5}));
    meshes.push_back(triangle({x, 1, -9}, {x, 1, -9}, {x + 1, 2, -9}));  // no area
    meshes.push_back(
        triangle({x, -20, 30}, {x, 20, -30}, {x, 20, 30}));  // parallel to the depth axis
  }
  for (int j = 0; j < 8; ++j) {  // exactly in a row's plane
    const optics::SubpixelRay ray = model.ray(2, j, 1);
    const auto at = [&](double x, double z) { return Vec3{x, ray.lens_y_mm + ray.tan_y * z, z}; };
    meshes.push_back(triangle(at(-30, -20), at(30, -20), at(0, 25)));
  }
  const Counts counts = count_frame(testing::make_rig({}), scene_of(meshes), plain_stage());
  EXPECT_EQ(counts.wrong, 0);
  EXPECT_LE(counts.close, 3);
}

TEST(RowSweep, LeavesNoHolesInClosedMeshes) {
  // Corners and edges lie exactly on rays: the grid's corners are the rays' points in the panel's
  // plane.
  const optics::Rig rig = testing::make_rig({.pitch_subpx = 9.0, .slant = 0.0});
  const optics::OpticalModel model(rig);
  TriangleMesh grid;
  constexpr uint32_t kAcross = 36, kDown = 8;
  for (uint32_t j = 0; j < kDown; ++j)
    for (uint32_t s = 0; s < kAcross; ++s) {
      const auto ray =
          model.ray(static_cast<int>(s) / 3, static_cast<int>(j), static_cast<int>(s % 3));
      const double z = -40.0;
      grid.positions.push_back({ray.lens_x_mm + z * ray.tan_x, ray.lens_y_mm + z * ray.tan_y, z});
    }
  for (uint32_t j = 0; j + 1 < kDown; ++j)
    for (uint32_t s = 0; s + 1 < kAcross; ++s) {
      const uint32_t a = j * kAcross + s;
      grid.triangles.push_back({a, a + 1, a + kAcross});
      grid.triangles.push_back({a + 1, a + kAcross + 1, a + kAcross});
    }
  const Scene scene(scene_of({grid}), plain_stage(), {}, 1);
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  RowSweep::Worker worker(sweep);
  SweptRow row;
  for (int j = 1; j + 1 < static_cast<int>(kDown); ++j) {
    worker.sweep(j, row);
    for (size_t s = 9; s < kAcross - 9; ++s) EXPECT_NE(row.cut[s], SweptRow::kNothing) << j << s;
  }
}

/// Cuts of two triangles that share an edge end in the same bits, so that no ray passes between
/// them: the cut of a closed mesh is closed.
TEST(RowSweep, CutsOfClosedMeshesAreClosed) {
  const optics::OpticalModel model(testing::make_rig({.height = 300, .pixel_mm = 0.2}));
  const Scene scene(scene_of({testing::ball_mesh({0.1, 0.2, 0.3}, 60.0, 60, 0)}),
                    testing::make_tiny_stage({.mm_per_unit = 1.0, .turn_degrees = 11.0}), {}, 1);
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  RowSweep::Worker worker(sweep);
  SweptRow row;
  for (int j = 0; j < 300; ++j) {
    worker.sweep(j, row);
    std::map<std::pair<float, float>, int> ends;
    for (const SweptCut& cut : row.cuts) ++ends[{cut.x0, cut.z0}], ++ends[{cut.x1, cut.z1}];
    EXPECT_GT(ends.size(), 100U);
    for (const auto& [end, count] : ends) ASSERT_EQ(count % 2, 0) << j;
  }
}

TEST(RowSweep, BarycentricsAgreeWithTheRay) {
  const optics::OpticalModel model(testing::make_rig({}));
  const Vec3 a{-60, -45, -20}, b{65, -40, 10}, c{5, 80, -30};
  const Scene scene(scene_of({triangle(a, b, c)}), plain_stage(), {}, 1);
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  RowSweep::Worker worker(sweep);
  SweptRow row;
  int seen = 0;
  for (int j = 0; j < 8; ++j) {
    worker.sweep(j, row);
    for (int s = 0; s < 36; ++s) {
      const auto at = static_cast<size_t>(s);
      if (row.cut[at] == SweptRow::kNothing) continue;
      ++seen;
      const SweptCut& cut = row.cuts[static_cast<size_t>(row.cut[at])];
      const double part = row.along[at];
      const double u = cut.u0 + part * (cut.u1 - cut.u0), v = cut.v0 + part * (cut.v1 - cut.v0);
      const testing::OracleRay ray = testing::oracle_ray(model, s / 3, j, s % 3);
      const Vec3 p = a * (1.0 - u - v) + b * u + c * v;
      EXPECT_NEAR(p.z, row.z_mm[at], 1e-4);
      EXPECT_NEAR(p.x, ray.x_mm + ray.tan_x * p.z, 1e-4);
      EXPECT_NEAR(p.y, ray.y_mm + ray.tan_y * p.z, 1e-4);
    }
  }
  EXPECT_GT(seen, 100);
}

TEST(RowSweep, GivesTheSameBitsOnEveryInstructionSet) {
  for (const NamedRig& rig : tiny_rigs())
    for (const testing::NamedScene& named : testing::tiny_scenes()) {
      const optics::OpticalModel model(rig.rig);
      const Scene scene(named.scene, testing::make_tiny_stage({.turn_degrees = 7.0}), {}, 1);
      const RowPlanes best(model, Isa::Baseline);
      const RowSweep sweep(best, scene);
      RowSweep::Worker worker(sweep);
      for (const Isa isa : {Isa::Avx2, Isa::Avx512}) {
        const RowPlanes planes(model, isa);
        const RowSweep other_sweep(planes, scene);
        RowSweep::Worker other_worker(other_sweep);
        SweptRow row, other;
        for (int j = 0; j < rig.rig.panel.height_px; ++j) {
          worker.sweep(j, row);
          other_worker.sweep(j, other);
          for (size_t s = 0; s < best.row_subpixels(); ++s) {
            ASSERT_EQ(row.cut[s], other.cut[s]) << rig.name << " " << named.name << " " << j;
            ASSERT_EQ(row.z_mm[s], other.z_mm[s]);
            ASSERT_EQ(row.along[s], other.along[s]);
          }
        }
      }
    }
}

TEST(RowSweep, ARowAloneEqualsTheRowOfTheFrame) {
  const optics::OpticalModel model(testing::make_rig({.width = 30, .height = 40}));
  const Scene scene(testing::tiny_scenes().front().scene,
                    testing::make_tiny_stage({.mm_per_unit = 25.0}), {}, 1);
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  RowSweep::Worker in_turn(sweep);
  SweptRow row, alone;
  for (int j = 0; j < 40; ++j) {
    in_turn.sweep(j, row);
    RowSweep::Worker worker(sweep);
    worker.sweep(j, alone);
    for (size_t s = 0; s < planes.row_subpixels(); ++s) {
      ASSERT_EQ(row.cut[s], alone.cut[s]);
      ASSERT_EQ(row.z_mm[s], alone.z_mm[s]);
    }
  }
}

/// Returns small scattered objects for a panel several tiles wide.
SceneDescription strewn_objects(std::mt19937_64& random) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  SceneDescription scene;
  scene.source = "test";
  scene.materials = {Material{}};
  for (int n = 0; n < 3; ++n) {
    const Vec3 at{80.0 * any(random), 0.5 * any(random), 25.0 * any(random)};
    scene.meshes.push_back(testing::rectangle_mesh(at, {8, any(random), any(random)},
                                                   {any(random), 4, 6 * any(random)}, 0));
  }
  scene.spheres = {{.centre = {80.0 * any(random), any(random), 20.0 * any(random)}, .radius = 3}};
  return scene;
}

/// Returns rigs several tiles wide.
std::vector<NamedRig> wide_rigs() {
  const auto make = [](testing::TinyRig rig) {
    rig.width = 1200;
    rig.height = 160;
    rig.pixel_mm = 0.15;
    optics::Rig made = testing::make_rig(rig);
    // Lobes of ten degrees, as kiosks have; polynomials fit lobes of thirty degrees less well.
    made.sheet.gap = Millimetres(3.0 * made.sheet.gap.value);
    return made;
  };
  std::vector<NamedRig> rigs = {
      {"slanted", make({})},
      {"upright", make({.pitch_subpx = 9.0, .slant = 0.0})},
      {"parallel", make({.distance_mm = kInfinity, .eye_height_mm = -0.2})},
      {"leaning left", make({.pitch_subpx = 5.3, .slant = -0.7})},
      {"wide lenses", make({.pitch_subpx = 31.4, .slant = 0.2})},
      {"narrow lenses", make({.pitch_subpx = 2.2, .slant = 0.2})},
      {"nudged colours", make({})},
      {"residual", make({})},
  };
  std::mt19937_64 random(5);
  rigs[6].rig.sheet.channel_offset = {Subpixels(-0.2), Subpixels(0.0), Subpixels(0.3)};
  rigs[7].rig.sheet.residual = test::random_residual(random, 2, 2, 0.04);
  return rigs;
}

struct LeftOut {
  size_t rays = 0, of = 0;
};

/// Expects a row whose rays far from every object are skipped to agree with the whole row.
void expect_same_row(RowSweep::Worker& whole, RowSweep::Worker& partly, int row,
                     const Interval& eyes, LeftOut& left_out) {
  SweptRow all, some;
  whole.sweep(row, all);
  partly.sweep(row, some, eyes);
  const PlaneRays &made = whole.rays(), &few = partly.rays();
  left_out.of += made.end;
  for (size_t s = 0; s < made.end; ++s) {
    ASSERT_EQ(all.cut[s], some.cut[s]) << "row " << row << " subpixel " << s;
    ASSERT_EQ(all.z_mm[s], some.z_mm[s]);
    ASSERT_EQ(all.along[s], some.along[s]);
    if (s >= few.first && s < few.end) {
      ASSERT_EQ(made.x_mm[s], few.x_mm[s]);
      ASSERT_EQ(made.tan_x[s], few.tan_x[s]);
      continue;
    }
    ++left_out.rays;
  }
}

TEST(RowSweep, SkipsRaysFarFromEveryObject) {
  std::mt19937_64 random(8);
  for (const NamedRig& rig : wide_rigs()) {
    const optics::OpticalModel model(rig.rig);
    const RowPlanes planes(model);
    const RayReach reach = reach_of(planes);
    const Interval eyes = reach.eyes.widened(5.0);
    LeftOut left_out;
    for (int round = 0; round < 12; ++round) {
      SceneDescription objects = strewn_objects(random);
      if (round == 0) objects.meshes.clear(), objects.spheres.clear();
      const Scene scene(objects, testing::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1);
      const RowSweep sweep(planes, scene);
      RowSweep::Worker whole(sweep), partly(sweep);
      for (int row = 70; row < 90; ++row)
        ASSERT_NO_FATAL_FAILURE(expect_same_row(whole, partly, row, eyes, left_out)) << rig.name;
    }
    // All rays are made from the map itself if there is a residual map.
    if (rig.name == "residual")
      EXPECT_EQ(left_out.rays, 0U);
    else
      EXPECT_GT(left_out.rays, left_out.of / 10) << rig.name;
  }
}

TEST(RowSweep, AllocatesNothingAfterTheFirstFrame) {
  for (const NamedRig& rig : tiny_rigs()) {
    const optics::OpticalModel model(rig.rig);
    const Scene scene(testing::tiny_scenes().front().scene, testing::make_tiny_stage(), {}, 1);
    const RowPlanes planes(model);
    const RowSweep sweep(planes, scene);
    RowSweep::Worker worker(sweep);
    SweptRow row;
    const auto all = [&] {
      for (int j = 0; j < rig.rig.panel.height_px; ++j) worker.sweep(j, row);
    };
    all();
    const long before = allocations.load();
    all();
    EXPECT_EQ(allocations.load(), before) << rig.name;
  }
}

TEST(RowTracer, ComparesAndTimesEveryRow) {
  const optics::OpticalModel model(testing::make_rig({.width = 30, .height = 40}));
  const Scene scene(testing::tiny_scenes().front().scene, testing::make_tiny_stage(), {}, 1);
  const RowPlanes planes(model);
  const SweepDifference difference = compare_with_embree(planes, scene, 0, 1);
  EXPECT_EQ(difference.subpixels, 30U * 40U * 3U);
  EXPECT_EQ(difference.elsewhere, 0U);
  EXPECT_LT(difference.depth_mm, 1e-3);
  const SweepTiming timing = time_row_sweep(planes, scene, 2);
  EXPECT_EQ(timing.subpixels, 30U * 40U * 3U);
  EXPECT_GT(timing.cuts, 0U);
  EXPECT_GT(timing.seconds, timing.prepare_seconds);
}

TEST(RowBuckets, AreTheRangesThatHoldARow) {
  std::mt19937_64 random(3);
  for (const int rows : {1, 2, 7, 64, 100}) {
    std::vector<RowRange> ranges;
    for (int n = 0; n < 60; ++n) {
      const int first = static_cast<int>(random() % 120) - 10;
      ranges.push_back({first, first + static_cast<int>(random() % 30) - 3});
    }
    const RowBuckets buckets(rows, ranges);
    for (int row = 0; row < rows; ++row) {
      std::multiset<uint32_t> found, expected;
      buckets.visit(row, [&](uint32_t n) { found.insert(n); });
      for (uint32_t n = 0; n < ranges.size(); ++n)
        if (ranges[n].first <= row && row <= ranges[n].last) expected.insert(n);
      EXPECT_EQ(found, expected) << row << " of " << rows;
    }
  }
}

}  // namespace
}  // namespace lenticule::render
