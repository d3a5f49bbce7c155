// SPDX-License-Identifier: Apache-2.0
// Tests sixteen lanes in single precision against the formulas in double, and the instruction sets
// against each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <random>

#include "render/accel/ray_stream.h"
#include "render/integrator/pbr_tracer.h"
#include "render/rays/primary_packets.h"
#include "render/scene/surroundings.h"
#include "render/shading/pbr_scene.h"
#include "render/shading/shading.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_tiny_stage;

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  double in(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  bool one_in(int n) { return std::uniform_int_distribution<int>(1, n)(engine_) == 1; }
  Vec3 colour() { return {in(0.1, 1), in(0.1, 1), in(0.1, 1)}; }
  Vec3 direction() { return normalized(Vec3{in(-1, 1), in(-1, 1), in(-1, 1)}); }

 private:
  std::mt19937_64 engine_;
};

int add_noise(SceneDescription& scene, Random& random) {
  auto texture = std::make_shared<Texture>();
  texture->width = texture->height = 8;
  for (int n = 0; n < 8 * 8 * 4; ++n)
    texture->rgba.push_back(static_cast<float>(random.in(0.4, 0.8)));
  scene.textures.push_back(texture);
  return static_cast<int>(scene.textures.size()) - 1;
}

/// A material that is a base, a mirror and maybe sheen and a coat; every third one has textures.
PbrMaterial plain_material(SceneDescription& scene, Random& random) {
  PbrMaterial m;
  m.base_colour = random.colour();
  m.metallic = random.one_in(3) ? random.in(0, 1) : random.one_in(2) ? 1.0 : 0.0;
  m.roughness = random.in(0.1, 1.0);
  m.double_sided = random.one_in(2);
  m.specular = random.one_in(2) ? random.in(0, 1) : 1.0;
  m.ior = random.in(1.2, 2.0);
  if (random.one_in(3)) m.emission = random.colour() * 0.2;
  using enum PbrMaterial::AlphaMode;
  if (random.one_in(3)) m.alpha_mode = random.one_in(2) ? Blend : Mask;
  if (random.one_in(3)) m.sheen_colour = random.colour();
  m.sheen_roughness = random.in(0.1, 1.0);
  m.clearcoat = random.one_in(3) ? random.in(0, 1) : 0.0;
  m.clearcoat_roughness = random.one_in(3) ? 0.0 : random.in(0.2, 1);
  if (!random.one_in(3)) return m;
  // Highlights of smoother surfaces show the rounding of texture coordinates.
  m.roughness = std::max(m.roughness, 0.6);
  m.base_colour_texture.texture = add_noise(scene, random);
  m.metallic_roughness_texture.texture = m.occlusion_texture.texture = add_noise(scene, random);
  m.normal_texture.texture = add_noise(scene, random);
  m.emission_texture.texture = m.base_colour_texture.texture;
  m.sheen_colour_texture.texture = m.base_colour_texture.texture;
  m.sheen_roughness_texture.texture = m.metallic_roughness_texture.texture;
  m.clearcoat_roughness = 0.9;
  m.clearcoat_texture.texture = m.clearcoat_roughness_texture.texture = add_noise(scene, random);
  m.clearcoat_normal_texture.texture = m.normal_texture.texture;
  return m;
}

/// Gives a scene metallic-roughness materials, all but one of them plain.
SceneDescription with_plain_materials(SceneDescription scene, bool keep_lights) {
  Random random(scene.materials.size() + scene.meshes.size());
  for (Material& material : scene.materials)
    material = {.name = material.name,
                .pbr = std::make_shared<PbrMaterial>(plain_material(scene, random))};
  scene.materials.push_back(scene.materials.front());
  auto glass = std::make_shared<PbrMaterial>();
  glass->transmission = 1.0;
  scene.materials.back().pbr = glass;
  scene.spheres.push_back({.centre = {0.3, 0.2, 2.0},
                           .radius = 0.4,
                           .material = static_cast<int>(scene.materials.size()) - 1});
  for (TriangleMesh& mesh : scene.meshes)
    if (mesh.uvs.empty())
      for (const Vec3& p : mesh.positions)
        mesh.uvs.push_back({static_cast<float>(0.3 * p.x), static_cast<float>(0.2 * p.y - p.z)});
  if (!keep_lights) scene.lights.clear();
  return scene;
}

struct Result {
  PbrLanes::Found lanes;
  std::array<double, kPacket> alpha{};
  ColourLanes light{};
  std::vector<ColourLanes> brings{};
  std::vector<RayPacket> shadows{};
};

class PbrLanesOf : public ::testing::TestWithParam<test::NamedScene> {
 protected:
  PbrLanesOf() : beam_(TilePlan(test::make_rig({})).beam()) {}

  void aim(const Scene& scene, Random& random) {
    std::vector<PathRay> rays(kPacket);
    for (PathRay& ray : rays) {
      ray.origin = random.direction() * 60.0;
      ray.direction = normalized(random.direction() * 12.0 - ray.origin);
      ray.target = random.one_in(8) ? PathRay::kInactive : 0;
    }
    load_packet(rays, packet_);
    intersect16(packet_.valid, scene.embree, packet_.rays, Coherence::Incoherent);
  }

  [[nodiscard]] uint32_t met() const {
    uint32_t lanes = 0;
    for (size_t r = 0; r < kPacket; ++r)
      if (packet_.valid[r] != 0 && packet_.rays.hit.geomID[r] != Hit::kMiss) lanes |= kLaneBit[r];
    return lanes;
  }

  Result shade(const Scene& scene, PbrLanes& lanes) const {
    Result out;
    out.lanes = lanes.find(scene, beam_, packet_, met());
    if (out.lanes.all == 0) return out;
    for (size_t r = 0; r < kPacket; ++r) out.alpha[r] = lanes.alpha(r);
    lanes.shade(scene, out.light);
    FrameCounts counts;
    for (size_t light = 0; light < scene.lights.size(); ++light) {
      RayPacket& rays = out.shadows.emplace_back();
      init_packets({&rays, 1});
      lanes.light_rays(scene, light, rays.rays.ray, rays.valid, out.brings.emplace_back(), counts);
    }
    EXPECT_EQ(counts.invalid_rays, 0U);
    return out;
  }

  void expect_agrees(const Scene& scene, const Result& found, size_t r);

  BeamSize beam_;
  RayPacket packet_;
  int shaded_ = 0;
};

void expect_near(Vec3 found, Vec3 wanted, double within) {
  EXPECT_NEAR(found.x, wanted.x, within * (1.0 + std::abs(wanted.x)));
  EXPECT_NEAR(found.y, wanted.y, within * (1.0 + std::abs(wanted.y)));
  EXPECT_NEAR(found.z, wanted.z, within * (1.0 + std::abs(wanted.z)));
}

void PbrLanesOf::expect_agrees(const Scene& scene, const Result& found, size_t r) {
  const RTCRay16& ray = packet_.rays.ray;
  const Vec3 origin{double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}};
  const Vec3 direction =
      normalized(Vec3{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}});
  const Surface surface = surface_at(scene, {.origin = origin, .direction = direction},
                                     {.geometry = packet_.rays.hit.geomID[r],
                                      .primitive = packet_.rays.hit.primID[r],
                                      .distance = ray.tfar[r]});
  const PbrMaterial& material = *surface.material->pbr;
  const double z = scene.pbr->panel_from_scene().point(surface.point).z;
  const RayFootprint footprint{.across = scene.scene_from_panel.vector({beam_.across_mm(z), 0, 0}),
                               .along = scene.scene_from_panel.vector({0, beam_.along_mm(z), 0})};
  const bool is_plain = material.transmission == 0.0;
  ASSERT_EQ((found.lanes.all & kLaneBit[r]) != 0, is_plain);
  if (!is_plain) return;
  const SurfacePlace place = place_of(scene, surface, direction, footprint);
  InputReader reader(scene, place, nullptr, r);
  const PbrPoint point = scene.pbr->surface(surface, direction, place, reader).point;
  const bool is_seen = surface.outer_side || material.double_sided;
  EXPECT_NEAR(found.alpha[r], is_seen ? point.alpha : 0.0, 1e-4);
  const bool is_shown = found.alpha[r] > 0.0;
  ASSERT_EQ((found.lanes.shown & kLaneBit[r]) != 0, is_shown);
  ASSERT_EQ((found.lanes.passing & kLaneBit[r]) != 0, found.alpha[r] < 1.0);
  if (!is_shown) return;
  ++shaded_;
  const PbrShader shader(point);
  expect_near(
      found.light.of(r),
      shader.emitted() + shader.of_environment(scene.pbr->environment(), scene.pbr->frame()), 3e-5);
  for (size_t light = 0; light < scene.lights.size(); ++light) {
    const Arrival at = arrival(scene.pbr->unit_lights()[light], spawn_point(surface, Side::Viewer),
                               scene.frame.units_per_world, 0);
    const Vec3 brings =
        scene.lights[light].colour * shader.of_light(at.toward_light) * at.intensity;
    expect_near(found.brings[light].of(r), brings, 2e-4);
    if (found.shadows[light].valid[r] == 0) {
      EXPECT_LT(length(brings), 1e-4);
      continue;
    }
    const RTCRay16& shadow = found.shadows[light].rays.ray;
    EXPECT_LT(
        length(Vec3{double{shadow.dir_x[r]}, double{shadow.dir_y[r]}, double{shadow.dir_z[r]}} -
               at.toward_light),
        1e-5);
  }
}

TEST_P(PbrLanesOf, AgreesWithDoublePrecisionLaneByLane) {
  for (const bool has_lights : {true, false})
    for (const bool has_sky : {true, false}) {
      const Scene scene(with_plain_materials(GetParam().scene, has_lights), make_tiny_stage(),
                        {.sky = has_sky}, 1);
      Random random(7);
      PbrLanes lanes(Isa::Baseline);
      for (int round = 0; round < 100; ++round) {
        aim(scene, random);
        const Result found = shade(scene, lanes);
        for (uint32_t left = met(); left != 0; left &= left - 1) {
          const auto r = static_cast<size_t>(std::countr_zero(left));
          expect_agrees(scene, found, r);
          ASSERT_FALSE(HasFailure()) << "round " << round << " lane " << r;
        }
      }
    }
  EXPECT_GT(shaded_, 400);
}

/// Includes the first set again, since a machine may have only the baseline.
TEST_P(PbrLanesOf, GivesTheSameBitsOnEveryInstructionSet) {
  const Scene scene(with_plain_materials(GetParam().scene, true), make_tiny_stage(), {.sky = true},
                    1);
  Random random(11);
  PbrLanes first(Isa::Baseline);
  for (int round = 0; round < 40; ++round) {
    aim(scene, random);
    const Result wanted = shade(scene, first);
    for (const Isa isa : test::every_instruction_set()) {
      PbrLanes lanes(isa);
      const Result found = shade(scene, lanes);
      ASSERT_EQ(found.lanes.all, wanted.lanes.all);
      ASSERT_EQ(found.lanes.passing, wanted.lanes.passing);
      for (uint32_t left = wanted.lanes.shown; left != 0; left &= left - 1) {
        const auto r = static_cast<size_t>(std::countr_zero(left));
        ASSERT_EQ(found.light.of(r), wanted.light.of(r)) << isa_name(isa);
        ASSERT_EQ(found.alpha[r], wanted.alpha[r]) << isa_name(isa);
        for (size_t light = 0; light < scene.lights.size(); ++light)
          ASSERT_EQ(found.brings[light].of(r), wanted.brings[light].of(r)) << isa_name(isa);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, PbrLanesOf, ::testing::ValuesIn(test::tiny_scenes()),
                         [](const auto& scene) { return scene.param.name; });

TEST(PbrLanesToneMap, IsTheOneOfSinglePoints) {
  Random random(3);
  for (const Isa isa : test::every_instruction_set()) {
    const PbrLanes lanes(isa);
    for (const ToneMap map : {ToneMap::None, ToneMap::PbrNeutral, ToneMap::Aces})
      for (const double most : {0.05, 1.0, 20.0}) {
        ColourLanes light{}, shown{};
        for (size_t r = 0; r < kPacket; ++r)
          light.set(r, {random.in(0, most), random.in(0, most), random.in(0, most)});
        lanes.tone_map(map, light, shown);
        for (size_t r = 0; r < kPacket; ++r)
          expect_near(shown.of(r), tone_mapped(map, light.of(r)), 3e-6);
      }
  }
}

}  // namespace
}  // namespace lenticule::render
