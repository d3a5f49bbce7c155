// SPDX-License-Identifier: Apache-2.0
// Tests that pictures have no pinholes at corners that lie exactly on the rays of subpixels, and
// that the crack filter changes nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "lab/stability/probes.h"
#include "render/integrator/packet_tracer.h"
#include "render/methods/method.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using lab::HoleGuard;

constexpr int kWidth = 480, kHeight = 320;
constexpr int kEvery = 4;  // rows between fans, which are also mm, since pixels are 1 mm high

optics::Rig rig() { return test::make_rig({.width = kWidth, .height = kHeight, .pixel_mm = 1.0}); }

Stage stage() { return test::make_tiny_stage({.mm_per_unit = 1.0}); }

SceneDescription bright_on_black() {
  SceneDescription scene;
  scene.source = "fans";
  scene.colour_managed = false;
  scene.background = {0, 0, 0};
  scene.ambient = Vec3{1, 1, 1};
  scene.materials = {Material{}};
  return scene;
}

/// Adds eight triangles around a point of the panel's plane, as high as wide.
void add_fan(TriangleMesh& mesh, Vec3 middle, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.push_back(middle);
  constexpr uint32_t kAround = 8;
  for (uint32_t k = 0; k < kAround; ++k) {
    const double angle = 6.283185307179586 * (k + 0.2 * unit(random)) / kAround;
    mesh.positions.push_back(
        middle + Vec3{1.8 * std::cos(angle), 1.8 * std::sin(angle), -0.3 + 0.1 * unit(random)});
    mesh.triangles.push_back({first, first + 1 + k, first + 1 + (k + 1) % kAround});
  }
}

/// Returns a small triangle near the eye: rays start there, which reduces the precision of the
/// corners.
TriangleMesh far_start() {
  return test::rectangle_mesh({0, 0, 600}, {1e-3, 0, 0}, {0, 1e-3, 0}, 0);
}

/// A fan centred on the ray of every twelfth subpixel of every fourth row.
struct Fans {
  Fans() {
    const optics::OpticalModel model(rig());
    SceneDescription empty = bright_on_black();
    empty.meshes = {far_start()};
    const Scene committed(empty, stage(), {}, 1);
    const lab::PrimaryProbe probe(committed, model, best_isa());
    std::mt19937_64 random(20240607);
    TriangleMesh mesh;
    std::vector<lab::PrimaryProbe::Line> lines;
    for (int tile = 0; tile < probe.tiles(); ++tile) {
      probe.lines(tile, lines);
      for (const lab::PrimaryProbe::Line& line : lines) {
        if (line.row % kEvery != 1 || line.subpixel % (3 * kEvery) != 4) continue;
        const double z = 2.0 * std::sin(line.row + line.subpixel);
        add_fan(mesh, {line.x_mm + z * line.tan_x, line.y_mm + z * line.tan_y, z}, random);
        aimed.push_back(line);
      }
    }
    scene = bright_on_black();
    scene.meshes = {mesh, far_start()};
  }
  SceneDescription scene;
  std::vector<lab::PrimaryProbe::Line> aimed;
};

RenderStatistics render(const SceneDescription& description, int threads,
                        frames::WovenFrame& frame) {
  const optics::OpticalModel model(rig());
  const Scene scene(description, stage(), {}, threads);
  return make_method("full", model, {.threads = threads, .cancelled = {}})
      ->render(scene, stage(), frame);
}

TEST(HoleGuard, LeavesNoPinholesInPictures) {
  const Fans fans;
  ASSERT_GT(fans.aimed.size(), 9000U);
  frames::WovenFrame frame({kWidth, kHeight});
  const RenderStatistics statistics = render(fans.scene, 2, frame);
  EXPECT_GT(statistics.filled_holes, 0U) << "nothing slipped";
  int holes = 0;
  for (const lab::PrimaryProbe::Line& line : fans.aimed)
    if (frame.row(line.row)[line.subpixel] == 0) ++holes;
  EXPECT_EQ(holes, 0);
}

/// Counts the lanes that end 16 steps behind the nearer of their neighbours or a step behind both,
/// lane by lane. Neighbours that do not exist or are inactive are infinitely far.
uint64_t suspects_plainly(const RayPacket& packet, float step) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const auto distance = [&](int r) {
    const bool exists = r >= 0 && r < int{kPacket};
    const auto lane = static_cast<size_t>(std::clamp(r, 0, int{kPacket} - 1));
    return exists && packet.valid[lane] != 0 ? packet.rays.ray.tfar[lane] : kFar;
  };
  uint64_t count = 0;
  for (int r = 0; r < int{kPacket}; ++r) {
    const auto [nearer, farther] = std::minmax({distance(r - 1), distance(r + 1)});
    if (packet.valid[static_cast<size_t>(r)] == 0) continue;
    count += distance(r) > nearer + 16.0F * step || distance(r) > farther + step ? 1 : 0;
  }
  return count;
}

TEST(HoleGuard, SuspectsRaysThatContinuePastTheirNeighbours) {
  SceneDescription nearly_empty = bright_on_black();
  nearly_empty.meshes = {far_start()};
  const Scene scene(nearly_empty, stage(), {}, 1);
  std::mt19937_64 random(3);
  uint64_t all = 0;
  for (int round = 0; round < 20000; ++round) {
    RayPacket packet{};
    for (size_t r = 0; r < kPacket; ++r) {
      packet.valid[r] = random() % 6 == 0 ? 0 : -1;
      set_lane(packet, r, Vec3f(Vec3{0, 0, 500}), Vec3f(Vec3{0, 0, -1}));
      packet.rays.hit.geomID[r] = RTC_INVALID_GEOMETRY_ID;
      if (random() % 5 != 0)
        packet.rays.ray.tfar[r] = 500.0F + static_cast<float>(random() % (1 << round % 8));
    }
    FrameCounts counts;
    fill_holes(scene, 1.0, packet, counts);
    ASSERT_EQ(counts.suspected_holes, suspects_plainly(packet, 1.0F)) << "round " << round;
    all += counts.suspected_holes;
  }
  EXPECT_GT(all, 20000U);
}

TEST(HoleGuard, KeepsTrueGapsOpen) {
  // The sheet has a slit, a twentieth of a millimetre wide, through which some rays pass.
  SceneDescription scene = bright_on_black();
  scene.meshes = {test::rectangle_mesh({-300, -200, 1}, {600, 0, 0}, {0, 200, 0}, 0),
                  test::rectangle_mesh({-300, 0.05, 1}, {600, 0, 0}, {0, 200, 0}, 0)};
  // Rows lie half a pixel from the middle, so the scene is turned until the slit crosses rows.
  for (TriangleMesh& mesh : scene.meshes)
    for (Vec3& p : mesh.positions) p = {0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y, p.z};
  frames::WovenFrame frame({kWidth, kHeight});
  const RenderStatistics statistics = render(scene, 2, frame);
  EXPECT_GT(statistics.suspected_holes, 0U);
  EXPECT_EQ(statistics.filled_holes, 0U);
  EXPECT_GT(std::ranges::count(frame.bytes(), 0), 100);
}

}  // namespace
}  // namespace lenticule::render
