// SPDX-License-Identifier: Apache-2.0
// Tests the row sweep against Embree on whole rows of large panels and of random rigs. Where the
// two see different surfaces, the reference decides if the ray passes an edge or a place where two
// surfaces meet.
#include <gtest/gtest.h>

#include <random>

#include "lab/stability/probes.h"
#include "render/rays/primary_rays.h"
#include "tests/support/oracles/visibility_oracle.h"
#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::Evaluation;

struct Counts {
  uint64_t subpixels = 0, seen = 0, different = 0, wrong = 0;
};

test::SeenSurface surface_of(const SweptRow& row, size_t s) {
  if (row.cut[s] == SweptRow::kNothing) return {};
  const SweptCut& cut = row.cuts[static_cast<size_t>(row.cut[s])];
  return {false, cut.geometry, cut.primitive, row.z_mm[s]};
}

/// Rows of one scene on one rig.
class Rows {
 public:
  Rows(const optics::Rig& rig, const SceneDescription& description, const Stage& stage)
      : model_(rig),
        scene_(description, stage, {}, 1),
        planes_(model_),
        sweep_(planes_, scene_),
        worker_(sweep_),
        tracer_(model_, scene_),
        start_mm_(primary_start_mm(scene_.near_mm, rig.viewing.distance.value)) {}

  void compare(int j, Counts& counts) {
    worker_.sweep(j, swept_);
    tracer_.trace(j, traced_);
    for (size_t s = 0; s < traced_.hits.size(); ++s) {
      const test::SeenSurface seen = surface_of(swept_, s);
      const Hit& hit = traced_.hits[s];
      const bool nothing = hit.geometry >= Hit::kRefused;
      ++counts.subpixels;
      counts.seen += seen.nothing ? 0 : 1;
      if (nothing == seen.nothing &&
          (nothing || (hit.geometry == seen.geometry && hit.primitive == seen.primitive)))
        continue;
      ++counts.different;
      evaluate_ray(j, static_cast<int>(s), seen, counts);
    }
  }

 private:
  void evaluate_ray(int j, int s, const test::SeenSurface& seen, Counts& counts) {
    const auto hits =
        test::oracle_hits(scene_, test::oracle_ray(model_, s / 3, j, s % 3), start_mm_);
    if (evaluate(hits, seen) != Evaluation::Wrong) return;
    if (++counts.wrong < 10)
      ADD_FAILURE() << "row " << j << " subpixel " << s << " sees "
                    << (seen.nothing ? "nothing" : "a wrong surface") << " at " << seen.z_mm;
  }

  optics::OpticalModel model_;
  Scene scene_;
  RowPlanes planes_;
  RowSweep sweep_;
  RowSweep::Worker worker_;
  lab::RowTracer tracer_;
  lab::RowTracer::Seen traced_;
  SweptRow swept_;
  double start_mm_;
};

/// Returns balls of many small triangles, boxes, spheres and cones, over a width of `extent_mm`.
SceneDescription crowd(std::mt19937_64& random, double extent_mm) {
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
  };
  const auto place = [&](double depth) {
    return Vec3{uniform(-0.5, 0.5), uniform(-0.3, 0.3), uniform(-depth, depth)} * extent_mm;
  };
  SceneDescription scene;
  scene.materials = {Material{}};
  for (int n = 0; n < 6; ++n)
    scene.meshes.push_back(
        test::ball_mesh(place(0.1), extent_mm * uniform(0.02, 0.15), 8 + 4 * n, 0));
  const Vec3 low = place(0.2);
  scene.meshes.push_back(test::box_mesh(low, low + Vec3{0.2, 0.3, 0.1} * extent_mm, 0));
  for (int n = 0; n < 20; ++n) {
    scene.spheres.push_back({.centre = place(0.1), .radius = extent_mm * uniform(0.003, 0.06)});
    scene.cones.push_back({.base = place(0.1),
                           .base_radius = extent_mm * uniform(0.002, 0.05),
                           .apex = place(0.1),
                           .apex_radius = extent_mm * uniform(0.0, 0.03)});
  }
  return scene;
}

Stage stage_for(std::mt19937_64& random) {
  return test::make_tiny_stage({.mm_per_unit = 1.0,
                                .depth_scale = random() % 2 == 0 ? 1.0 : 0.3,
                                .turn_degrees = static_cast<double>(random() % 90) - 45.0});
}

TEST(RowSweepAgainstEmbree, AgreesOnKioskRows) {
  std::mt19937_64 random(11);
  const optics::Rig rig = test::kiosk_rig();
  const double width = rig.panel.width_px * rig.panel.pixel_width.value;
  Counts counts;
  for (int scene = 0; scene < 3; ++scene) {
    Rows rows(rig, crowd(random, width), stage_for(random));
    for (int n = 0; n < 12; ++n) rows.compare(static_cast<int>(random() % 2160), counts);
  }
  EXPECT_EQ(counts.wrong, 0U);
  EXPECT_GT(counts.seen, counts.subpixels / 10);
  EXPECT_LE(counts.different, counts.subpixels / 10000) << counts.subpixels;
  RecordProperty("different", static_cast<int>(counts.different));
}

TEST(RowSweepAgainstEmbree, AgreesOnRandomRigs) {
  std::mt19937_64 random(12);
  Counts counts;
  for (int n = 0; n < 60; ++n) {
    const optics::Rig rig = test::random_rig(random);
    SCOPED_TRACE(n);
    const double width = rig.panel.width_px * rig.panel.pixel_width.value;
    Rows rows(rig, crowd(random, width), stage_for(random));
    for (int k = 0; k < 2; ++k)
      rows.compare(static_cast<int>(random() % static_cast<uint64_t>(rig.panel.height_px)), counts);
  }
  EXPECT_EQ(counts.wrong, 0U);
  EXPECT_GT(counts.seen, counts.subpixels / 20);
  EXPECT_LE(counts.different, counts.subpixels / 5000) << counts.subpixels;
}

}  // namespace
}  // namespace lenticule::render
