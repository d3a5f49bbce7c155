// SPDX-License-Identifier: Apache-2.0
// Tests that the row sweep skips the rays far from every object, and no others.
#include <gtest/gtest.h>

#include <random>

#include "render/methods/adaptive/key_samples.h"
#include "render/row_sweep/row_sweep.h"
#include "tests/unit/render/row_sweep_scenes.h"

namespace lenticule::render {
namespace {

/// Returns small scattered objects for a panel several tiles wide.
SceneDescription strewn_objects(std::mt19937_64& random) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  SceneDescription scene;
  scene.source = "test";
  scene.materials = {Material{}};
  for (int n = 0; n < 3; ++n) {
    const Vec3 at{80.0 * any(random), 0.5 * any(random), 25.0 * any(random)};
    scene.meshes.push_back(test::rectangle_mesh(at, {8, any(random), any(random)},
                                                {any(random), 4, 6 * any(random)}, 0));
  }
  scene.spheres = {{.centre = {80.0 * any(random), any(random), 20.0 * any(random)}, .radius = 3}};
  return scene;
}

/// Returns rigs several tiles wide.
std::vector<NamedRig> wide_rigs() {
  const auto make = [](test::TinyRig rig) {
    rig.width = 1200;
    rig.height = 160;
    rig.pixel_mm = 0.15;
    optics::Rig made = test::make_rig(rig);
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
      const Scene scene(objects, test::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1);
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

}  // namespace
}  // namespace lenticule::render
