// SPDX-License-Identifier: Apache-2.0
// Tests rays that are culled because they provably hit nothing: the bounds behind the test, and the
// bytes.
#include "render/culling/background.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render/methods/method.h"
#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

bool holds(const Interval& interval, double value) {
  return value >= interval.low && value <= interval.high;
}

/// Expects every ray that Embree would trace to lie within the bounds of its columns.
void expect_bounds_hold(const optics::Rig& rig, const Scene& scene, int tile_index) {
  const optics::OpticalModel model(rig);
  const TilePlan plan(rig);
  const PrimaryPackets packets(model, plan);
  PrimaryPackets::Maker maker(packets);
  const Tile tile = plan.tile(tile_index % plan.count());
  maker.start(scene, tile, Footprint(model, {}));
  std::vector<RayPacket> made(static_cast<size_t>(tile.columns));
  init_packets(made);
  maker.prepare(made);
  maker.columns(0, made);
  uint64_t rays = 0;
  for (const ColumnRange columns :
       {ColumnRange{0, 48}, ColumnRange{48, 384}, ColumnRange{0, 384}}) {
    Beam beam;
    ASSERT_TRUE(maker.beam(columns, beam));
    uint64_t valid = 0;
    for (int c = columns.begin; c < columns.end; ++c) {
      const RayPacket& packet = made[static_cast<size_t>(c)];
      const RTCRay16& ray = packet.rays.ray;
      for (size_t r = 0; r < kPacket; ++r) {
        if (packet.valid[r] == 0) continue;
        ++valid;
        // The scene's axes equal the panel's here.
        const double tan_x = double{ray.dir_x[r]} / double{ray.dir_z[r]};
        const double tan_y = double{ray.dir_y[r]} / double{ray.dir_z[r]};
        ASSERT_TRUE(holds(beam.tan_x, tan_x)) << c << ' ' << r;
        ASSERT_TRUE(holds(beam.tan_y, tan_y)) << c << ' ' << r;
        ASSERT_TRUE(holds(beam.x_mm, double{ray.org_x[r]} - tan_x * beam.start_mm)) << c;
        ASSERT_TRUE(holds(beam.y_mm, double{ray.org_y[r]} - tan_y * beam.start_mm)) << c;
      }
    }
    EXPECT_EQ(maker.count(columns), valid);
    rays += valid;
  }
  EXPECT_GT(rays, 0U);
}

TEST(Beam, HoldsTheRaysOfRandomRigs) {
  std::mt19937_64 random(20261122);
  // With a power of two a scene unit is a millimetre.
  const Scene scene(test::tiny_scenes().front().scene, test::make_tiny_stage({.mm_per_unit = 8.0}),
                    {});
  for (int n = 0; n < 80; ++n) {
    SCOPED_TRACE(n);
    const optics::Rig rig = n == 0   ? test::kiosk_rig()
                            : n == 1 ? test::upright_rig()
                                     : test::random_rig(random);
    const TilePlan plan(rig);
    for (int k = 0; k < 6; ++k)
      expect_bounds_hold(rig, scene,
                         static_cast<int>(random() % static_cast<unsigned>(plan.count())));
  }
}

std::vector<optics::Rig> some_rigs() {
  std::vector<optics::Rig> rigs = {
      test::make_rig({.width = 300, .height = 140, .pixel_mm = 0.5}),
      test::make_rig({.width = 260, .height = 90, .slant = -0.2, .pixel_mm = 0.5}),
      test::make_rig({.width = 200, .height = 90, .layout = "cells", .pixel_mm = 0.6}),
      test::make_rig({.width = 200, .height = 90, .distance_mm = HUGE_VAL, .pixel_mm = 0.6})};
  std::mt19937_64 random(5);
  rigs.push_back(rigs.front());
  rigs.back().sheet.residual = test::random_residual(random, 6, 4, 0.2);
  return rigs;
}

const Surroundings kFlat{.background = Vec3{0.2, 0.5, 0.7}, .environment_file = {}};
const Surroundings kSky{.background = {}, .sky = true, .environment_file = {}};
const Surroundings kGround{.background = {}, .environment_file = {}, .ground = true};

struct Counts {
  uint64_t culled = 0;
  uint64_t rays = 0;
};

void expect_same_bytes(const SceneDescription& description, const optics::Rig& rig,
                       const Surroundings& surroundings, const RenderOptions& options,
                       Counts& counts) {
  const optics::OpticalModel model(rig);
  const Stage stage = test::make_tiny_stage({.mm_per_unit = 6.0});
  const Scene scene(description, stage, surroundings);
  const frames::FrameGeometry geometry{rig.panel.width_px, rig.panel.height_px,
                                       frames::PixelFormat::Rgb8};
  frames::WovenFrame skipped(geometry), traced(geometry);
  const auto render = [&](bool skip, frames::WovenFrame& frame) {
    RenderOptions with = options;
    with.skip_background = skip;
    return make_method("full", model, with)->render(scene, stage, frame);
  };
  const RenderStatistics with = render(true, skipped);
  const RenderStatistics without = render(false, traced);
  EXPECT_EQ(skipped, traced);
  EXPECT_EQ(with.primary_rays, without.primary_rays);
  EXPECT_EQ(with.invalid_rays, without.invalid_rays);
  EXPECT_EQ(without.primary_rays_culled, 0U);
  counts.culled += with.primary_rays_culled;
  counts.rays += with.primary_rays;
}

TEST(Background, GivesTheSameBytesAsTracing) {
  Counts flat, sky;
  for (const optics::Rig& rig : some_rigs())
    for (const test::NamedScene& named : test::tiny_scenes()) {
      SCOPED_TRACE(named.name);
      expect_same_bytes(named.scene, rig, kFlat, {.cancelled = {}}, flat);
      expect_same_bytes(named.scene, rig, kSky, {.cancelled = {}}, sky);
    }
  EXPECT_GT(flat.culled, flat.rays / 10);
  EXPECT_LT(flat.culled, flat.rays);
  EXPECT_EQ(flat.culled, sky.culled);
}

TEST(Background, GivesTheSameBytesWithSeveralSamplesAndAGround) {
  Counts samples, ground;
  for (const test::NamedScene& named : test::tiny_scenes()) {
    SCOPED_TRACE(named.name);
    expect_same_bytes(named.scene, some_rigs().front(), kSky, {.samples = 2, .cancelled = {}},
                      samples);
    expect_same_bytes(named.scene, some_rigs().front(), kGround, {.cancelled = {}}, ground);
  }
  EXPECT_LT(ground.culled, ground.rays);
}

/// Small objects lie around the panel's plane with gaps of all sizes between them.
TEST(Background, GivesTheSameBytesAroundRandomObjects) {
  std::mt19937_64 random(77);
  std::uniform_real_distribution<double> place(-6.0, 6.0), size(0.02, 0.6);
  Counts counts;
  for (int n = 0; n < 12; ++n) {
    SCOPED_TRACE(n);
    SceneDescription scene;
    scene.background = {0.3, 0.1, 0.6};
    scene.materials.emplace_back();
    for (int k = 0; k < 4; ++k) {
      const Vec3 at{place(random), place(random) / 2.0, place(random)};
      scene.spheres.push_back({.centre = at, .radius = size(random)});
      const Vec3 low{place(random), place(random) / 2.0, place(random)};
      scene.meshes.push_back(test::box_mesh(low, low + Vec3{1, 1, 1} * size(random), 0));
      scene.cones.push_back({.base = -at, .base_radius = size(random), .apex = low * 0.3 - at});
    }
    const std::vector<optics::Rig> rigs = some_rigs();
    expect_same_bytes(scene, rigs[static_cast<size_t>(n) % rigs.size()], {}, {.cancelled = {}},
                      counts);
  }
  EXPECT_GT(counts.culled, counts.rays / 10);
}

}  // namespace
}  // namespace lenticule::render
