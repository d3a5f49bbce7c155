// SPDX-License-Identifier: Apache-2.0
// Tests the row sweep against every ray with every primitive, on rigs small enough for that.
#include "render/row_sweep/row_sweep.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iterator>

#include "render/rays/primary_rays.h"
#include "tests/support/oracles/visibility_oracle.h"
#include "tests/unit/render/row_sweep_scenes.h"

namespace lenticule::render {
namespace {

using test::Evaluation;

struct Counts {
  int right = 0, close = 0, wrong = 0, seen = 0;
};

test::SeenSurface surface_of(const SweptRow& row, size_t s) {
  if (row.cut[s] == SweptRow::kNothing) return {};
  const SweptCut& cut = row.cuts[static_cast<size_t>(row.cut[s])];
  return {false, cut.geometry, cut.primitive, row.z_mm[s]};
}

void count_row(const optics::OpticalModel& model, const Scene& scene, int j, const SweptRow& row,
               Counts& counts) {
  const double start = primary_start_mm(scene.near_mm, model.rig().viewing.distance.value);
  for (int s = 0; s < 3 * model.rig().panel.width_px; ++s) {
    const auto hits = test::oracle_hits(scene, test::oracle_ray(model, s / 3, j, s % 3), start);
    const test::SeenSurface seen = surface_of(row, static_cast<size_t>(s));
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
    for (const test::NamedScene& scene : test::tiny_scenes()) {
      SCOPED_TRACE(rig.name + ", " + scene.name);
      const Counts counts =
          count_frame(rig.rig, scene.scene, test::make_tiny_stage({.turn_degrees = 7.0}));
      EXPECT_EQ(counts.wrong, 0);
      EXPECT_GT(counts.seen, 0);
      sum.right += counts.right;
      sum.close += counts.close;
    }
  EXPECT_LE(sum.close, sum.right / 10000) << sum.right;
}

TEST(RowSweep, FollowsTheStage) {
  const auto scenes = test::tiny_scenes();
  const test::TinyStage stages[] = {{.depth_scale = 0.2},
                                    {.centre = {0.5, -0.3, 2.5}, .turn_degrees = -40.0},
                                    {.mm_per_unit = 30.0, .depth_scale = 3.0},
                                    {.depth_scale = 0.5, .turn_degrees = 33.0}};
  for (const test::TinyStage& stage : stages)
    for (const test::NamedScene& scene : scenes) {
      SCOPED_TRACE(scene.name);
      const Counts counts =
          count_frame(test::make_rig({}), scene.scene, test::make_tiny_stage(stage));
      EXPECT_EQ(counts.wrong, 0);
      EXPECT_LE(counts.close, 1);
    }
}

TEST(RowSweep, OmitsGeometryOutsideTheStage) {
  Stage stage = test::make_tiny_stage();
  stage.near_mm = -1.5;
  for (const test::NamedScene& scene : test::tiny_scenes()) {
    SCOPED_TRACE(scene.name);
    const Counts counts = count_frame(test::make_rig({}), scene.scene, stage);
    EXPECT_EQ(counts.wrong, 0);
    EXPECT_LE(counts.close, 1);
  }
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
      const Counts counts = count_frame(test::make_rig({.distance_mm = distance}),
                                        scene_of({cases[n]}), plain_stage());
      EXPECT_EQ(counts.wrong, 0);
      EXPECT_EQ(counts.close, 0);
    }
}

TEST(RowSweep, ACoveringTriangleHidesTheRest) {
  const TriangleMesh wall = triangle({-1e5, -1e5, 1}, {1e5, -1e5, 2}, {0, 2e5, 0});
  SceneDescription scene = scene_of({wall, test::box_mesh({-20, -20, -30}, {20, 20, -5}, 0)});
  for (const NamedRig& rig : tiny_rigs()) {
    SCOPED_TRACE(rig.name);
    const Counts counts = count_frame(rig.rig, scene, plain_stage());
    EXPECT_EQ(counts.wrong, 0);
    EXPECT_EQ(counts.seen, 3 * rig.rig.panel.width_px * rig.rig.panel.height_px);
  }
}

TEST(RowSweep, ReturnsNothingForAnEmptyScene) {
  const Counts counts = count_frame(test::make_rig({}), scene_of({}), plain_stage());
  EXPECT_EQ(counts.seen, 0);
  EXPECT_EQ(counts.wrong, 0);
}

TEST(RowSweep, HandlesSliversAndTrianglesSeenEdgeOn) {
  const optics::OpticalModel model(test::make_rig({}));
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
  const Counts counts = count_frame(test::make_rig({}), scene_of(meshes), plain_stage());
  EXPECT_EQ(counts.wrong, 0);
  EXPECT_LE(counts.close, 3);
}

}  // namespace
}  // namespace lenticule::render
