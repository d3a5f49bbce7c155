// SPDX-License-Identifier: Apache-2.0
// Compares rays made from polynomials with those of the map itself.
#include "render/rays/primary_packets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

/// Largest differences over a tile, for rays that exist in both.
struct Difference {
  double tangent = 0.0;
  double origin_mm = 0.0;
  int rays = 0;
  int wrong_lanes = 0;  ///< lanes with a ray in one only
};

Vec3 lane(const float* x, const float* y, const float* z, size_t r) {
  return {double{x[r]}, double{y[r]}, double{z[r]}};
}

Difference compare_tile(const PrimaryPackets& packets, const PrimaryRays& exact, const Scene& scene,
                        const Tile& tile, const Footprint& footprint) {
  PrimaryPackets::Maker maker(packets);
  std::vector<RayPacket> made(static_cast<size_t>(tile.columns));
  init_packets(made);
  maker.start(scene, tile, footprint);
  maker.prepare(made);
  maker.columns(0, made);
  PrimaryRays::Workspace workspace;
  std::vector<PathRay> rays;
  exact.generate(scene, tile, footprint, 1.0, workspace, rays);

  Difference d;
  for (size_t n = 0; n < rays.size(); ++n) {
    const RayPacket& packet = made[n / kPacket];
    const size_t r = n % kPacket;
    const bool there = rays[n].target != PathRay::kInactive;
    if (there != (packet.valid[r] != 0)) ++d.wrong_lanes;
    if (!there) continue;
    ++d.rays;
    const RTCRay16& ray = packet.rays.ray;
    const Vec3 way = lane(ray.dir_x, ray.dir_y, ray.dir_z, r);
    const Vec3 from = lane(ray.org_x, ray.org_y, ray.org_z, r);
    d.tangent = std::fmax(d.tangent, length(normalized(way) - rays[n].direction));
    d.origin_mm = std::fmax(d.origin_mm, length(from - rays[n].origin));
  }
  return d;
}

struct Bench {
  explicit Bench(const optics::Rig& rig, Isa isa = best_isa())
      : model(rig),
        plan(rig),
        packets(model, plan, isa),
        exact(model, plan),
        footprint(model, {}) {}
  optics::OpticalModel model;
  TilePlan plan;
  PrimaryPackets packets;
  PrimaryRays exact;
  Footprint footprint;
};

/// Returns the resolution of single precision for a coordinate of the panel, with a few roundings.
double origin_tolerance(const optics::Rig& rig, const Scene& scene, const PrimaryRays& exact) {
  const double size = rig.panel.width_px * rig.panel.pixel_width.value +
                      rig.panel.height_px * rig.panel.pixel_height.value +
                      std::abs(exact.start_mm(scene));
  return 4.0 * size / (1 << 24);
}

/// Returns the kiosk's panel with pixels twice as large, whose tiles need two parabolas each.
optics::Rig coarse_kiosk_rig() {
  optics::Rig rig = test::kiosk_rig();
  rig.panel.width_px /= 2;
  rig.panel.height_px /= 2;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.31134);
  rig.sheet.gap = Millimetres(4.476);
  return rig;
}

TEST(PrimaryPackets, RandomRigsAgreeWithTheMap) {
  std::mt19937_64 random(20261121);
  const auto description = test::tiny_scenes().front().scene;
  const Scene straight(description, test::make_tiny_stage(), {});
  const Scene turned(description, test::make_tiny_stage({.turn_degrees = 20.0}), {});
  int fast = 0, tiles = 0;
  for (int n = 0; n < 60; ++n) {
    const optics::Rig rig = n == 0   ? test::kiosk_rig()
                            : n == 1 ? test::upright_rig()
                            : n == 2 ? coarse_kiosk_rig()
                                     : test::random_rig(random);
    const Bench bench(rig);
    const Scene& scene = n % 2 == 0 ? turned : straight;
    fast += bench.packets.fast() ? 1 : 0;
    const double tolerance = origin_tolerance(rig, scene, bench.exact);
    for (int k = 0; k < 24; ++k) {
      const int count = bench.plan.count();
      const int index = k == 0   ? 0
                        : k == 1 ? count - 1
                                 : static_cast<int>(random() % static_cast<unsigned>(count));
      const Difference d =
          compare_tile(bench.packets, bench.exact, scene, bench.plan.tile(index), bench.footprint);
      ++tiles;
      EXPECT_EQ(d.wrong_lanes, 0) << "rig " << n << " tile " << index;
      EXPECT_LT(d.tangent, 4e-7) << "rig " << n << " tile " << index;
      EXPECT_LT(d.origin_mm, tolerance) << "rig " << n << " tile " << index;
    }
  }
  EXPECT_GT(fast, 10);
  EXPECT_EQ(tiles, 60 * 24);
}

TEST(PrimaryPackets, EveryInstructionSetGivesTheSameBits) {
  const auto description = test::tiny_scenes().front().scene;
  for (const double turn : {0.0, 20.0}) {
    const Scene scene(description, test::make_tiny_stage({.turn_degrees = turn}), {});
    for (const optics::Rig& rig : {test::kiosk_rig(), test::upright_rig(), coarse_kiosk_rig()}) {
      const auto tile_bits = [&](Isa isa, int index) {
        const Bench bench(rig, isa);
        PrimaryPackets::Maker maker(bench.packets);
        const Tile tile = bench.plan.tile(index % bench.plan.count());
        std::vector<RayPacket> made(static_cast<size_t>(tile.columns));
        init_packets(made);
        maker.start(scene, tile, bench.footprint);
        maker.prepare(made);
        maker.columns(0, made);
        std::vector<float> bits;
        for (const RayPacket& packet : made)
          bits.insert(bits.end(), packet.rays.ray.org_x, packet.rays.ray.tfar);
        return bits;
      };
      for (const Isa isa : {Isa::Avx2, Isa::Avx512}) {
        for (const int index : {0, 700, 2000})
          EXPECT_EQ(tile_bits(isa, index), tile_bits(Isa::Baseline, index)) << isa_name(isa);
      }
    }
  }
}

/// Upright lenses of a whole number of subpixels put every eighth column exactly on a border.
TEST(PrimaryPackets, BordersFollowTheMap) {
  optics::Rig rig = test::upright_rig();
  const auto description = test::tiny_scenes().front().scene;
  const Scene scene(description, test::make_tiny_stage(), {});
  for (const double pitch : {3.0, 6.0, 8.0, 16.0 / 3.0})
    for (const double slant : {0.0, 1.0 / 3.0, -1.0 / 6.0}) {
      rig.sheet.pitch = Subpixels{pitch};
      rig.sheet.slant = slant;
      const Bench bench(rig);
      for (int index = 0; index < bench.plan.count(); index += 97) {
        const Difference d = compare_tile(bench.packets, bench.exact, scene, bench.plan.tile(index),
                                          bench.footprint);
        EXPECT_EQ(d.wrong_lanes, 0);
        EXPECT_LT(d.tangent, 4e-7) << pitch << " " << slant << " tile " << index;
      }
    }
}

}  // namespace
}  // namespace lenticule::render
