// SPDX-License-Identifier: Apache-2.0
// Tests that rays leaving a surface do not hit it again at their start.
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/shading/shading.h"
#include "render/shading/shading_tables.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

class Sampler {
 public:
  double unit() { return distribution_(engine_); }
  Vec3 direction() {
    Vec3 v;
    do v = {unit(), unit(), unit()};
    while (dot(v, v) > 1.0 || dot(v, v) < 1e-4);
    return normalized(v);
  }

 private:
  std::mt19937_64 engine_{20240607};
  std::uniform_real_distribution<double> distribution_{-1.0, 1.0};
};

struct Shadows {
  int hits = 0;
  int self_shadowed = 0;
};

using Away = std::function<Vec3(Vec3 normal, Sampler&)>;

/// Sends packets of rays at the scene's only object, which is convex from `side`, and from every
/// hit one shadow ray into the open, along `away(normal)`.
class ShadowCounter {
 public:
  ShadowCounter(const SceneDescription& description, double size, Side side, Away away)
      : scene_(description, test::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1),
        size_(size),
        side_(side),
        away_(std::move(away)) {}

  Shadows count() {
    for (int n = 0; n < 1250; ++n) send_packet();
    return shadows_;
  }

 private:
  void send_packet() {
    std::vector<PathRay> rays(kPacket);
    for (PathRay& ray : rays) {
      const Vec3 aim = sampler_.direction() * (0.4 * size_);
      ray.origin = sampler_.direction() * (3.0 * size_);
      ray.direction = normalized(aim - ray.origin);
      ray.target = 0;
    }
    RayPacket packet;
    EXPECT_EQ(load_packet(rays, packet), 0U);
    const EmbreeScene& embree = scene_.embree;
    intersect16(packet.valid, embree, packet.rays, Coherence::Incoherent);
    shading_kernel::Surfaces surfaces{};
    if (!isa_baseline::kShadingKernel.find_surfaces(
            scene_.shading->tables(), &packet.rays.ray.org_x[0], packet.valid, surfaces))
      return;
    RayPacket shadow;
    EXPECT_EQ(load_packet(shadow_rays(surfaces), shadow), 0U);
    occluded16(shadow.valid, embree, shadow.rays.ray, Coherence::Incoherent);
    for (size_t r = 0; r < kPacket; ++r) {
      if (shadow.valid[r] == 0) continue;
      ++shadows_.hits;
      if (shadow.rays.ray.tfar[r] < 0.0F) ++shadows_.self_shadowed;
    }
  }

  std::vector<PathRay> shadow_rays(const shading_kernel::Surfaces& s) {
    std::vector<PathRay> rays(kPacket);
    for (size_t r = 0; r < kPacket; ++r) {
      if (s.active[r] == 0 || (side_ == Side::Far && s.outer_side[r] == 0)) continue;
      const auto lane = [r](const float(&v)[3][kPacket]) {
        return Vec3{double{v[0][r]}, double{v[1][r]}, double{v[2][r]}};
      };
      rays[r] = {
          .origin = lane(s.start), .direction = away_(lane(s.geometric), sampler_), .target = 0};
    }
    return rays;
  }

  Scene scene_;
  double size_;
  Side side_;
  Away away_;
  Sampler sampler_;
  Shadows shadows_;
};

Shadows count_self_shadows(const SceneDescription& description, double size, Side side,
                           const Away& away) {
  return ShadowCounter(description, size, side, away).count();
}

Vec3 anywhere(Vec3 normal, Sampler& sampler) {
  const Vec3 v = sampler.direction();
  return dot(v, normal) > 0.0 ? v : -v;
}

/// Returns a direction a hundredth of a degree above the surface.
Vec3 grazing(Vec3 normal, Sampler& sampler) {
  const Vec3 along = normalized(cross(normal, sampler.direction()));
  return normalized(along + normal * 1.7e-4);
}

class SelfIntersection : public ::testing::TestWithParam<double> {
 protected:
  static void expect_none(const SceneDescription& scene, double size, Side side = Side::Viewer) {
    for (const auto& away : {anywhere, grazing}) {
      const Shadows shadows = count_self_shadows(scene, size, side, away);
      EXPECT_GT(shadows.hits, 1500);
      EXPECT_EQ(shadows.self_shadowed, 0);
    }
  }
};

/// Returns 3200 triangles in one plane, apart from rounding: a grazing ray may hit a neighbour.
TriangleMesh grid_mesh(const Affine& place) {
  TriangleMesh grid;
  constexpr uint32_t kSide = 41;
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x)
      grid.positions.push_back(place.point({(x - 20.0) / 20.0, (y - 20.0) / 20.0, 0.0}));
  for (uint32_t y = 0; y + 1 < kSide; ++y)
    for (uint32_t x = 0; x + 1 < kSide; ++x) {
      const uint32_t a = y * kSide + x;
      grid.triangles.push_back({a, a + 1, a + kSide + 1});
      grid.triangles.push_back({a, a + kSide + 1, a + kSide});
    }
  return grid;
}

constexpr Affine kTilted{{1.0, 0.37, -0.21}, {0.3, -0.61, 1.0}, {0.4, 0.6, 0.9}, {}};

void expect_no_self_shadows(const SceneDescription& scene, double size) {
  const Shadows shadows = count_self_shadows(scene, size, Side::Viewer, anywhere);
  EXPECT_GT(shadows.hits, 1500);
  EXPECT_EQ(shadows.self_shadowed, 0);
}

TEST_P(SelfIntersection, NeverOnATiltedGridOfTriangles) {
  const double size = GetParam();
  SceneDescription scene;
  scene.materials = {Material{}};
  const Affine scaled{{size, 0, 0}, {0, size, 0}, {0, 0, size}, {}};
  scene.meshes = {grid_mesh(scaled * kTilted)};
  expect_no_self_shadows(scene, size);
}

/// The scene has so many coincident copies of the grid that Embree gets it once.
TEST_P(SelfIntersection, NeverOnInstancesOfATiltedGrid) {
  const double size = GetParam();
  SceneDescription scene;
  scene.materials = {Material{}};
  const Vec3 centre = Vec3{5.1, -3.3, 2.7} * size;
  scene.shapes = {std::make_shared<const TriangleMesh>(
      grid_mesh({{size, 0, 0}, {0, size, 0}, {0, 0, size}, centre}))};
  Affine place = kTilted;
  place.origin = -kTilted.vector(centre);
  scene.meshes.assign(170, {.material = 0, .shape = 0, .place = place});
  const Scene committed(scene, test::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1);
  EXPECT_EQ(committed.embree.has_instances(), size > 0.1 && committed.wide_triangles.empty());
  expect_no_self_shadows(scene, size);
}

TEST_P(SelfIntersection, NeverOnOneLargeTriangle) {
  const double size = GetParam();
  SceneDescription scene;
  scene.materials = {Material{}};
  TriangleMesh triangle;
  triangle.positions = {Vec3{-900, 311, -700} * size, Vec3{830, -290, -710} * size,
                        Vec3{37, -29, 1100} * size};
  triangle.triangles = {{0, 1, 2}};
  scene.meshes = {triangle};
  expect_none(scene, size);
}

TEST_P(SelfIntersection, NeverOnASphere) {
  SceneDescription scene;
  scene.materials = {Material{}};
  scene.spheres = {{.centre = Vec3{0.1, -0.2, 0.05} * GetParam(), .radius = 0.7 * GetParam()}};
  expect_none(scene, GetParam());
}

TEST_P(SelfIntersection, NeverOnTheOutsideOfACone) {
  SceneDescription scene;
  scene.materials = {Material{}};
  Cone cone;
  cone.base = Vec3{-0.3, -0.7, 0.1} * GetParam();
  cone.apex = Vec3{0.2, 0.8, -0.1} * GetParam();
  cone.base_radius = 0.6 * GetParam();
  cone.apex_radius = 0.1 * GetParam();
  scene.cones = {cone};
  expect_none(scene, GetParam(), Side::Far);
}

/// Sizes in millimetres on the panel: from a thousandth to ten kilometres.
INSTANTIATE_TEST_SUITE_P(Sizes, SelfIntersection, ::testing::Values(1e-3, 1.0, 300.0, 1e7));

}  // namespace
}  // namespace lenticule::render
