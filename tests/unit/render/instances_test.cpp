// SPDX-License-Identifier: Apache-2.0
// Tests scenes of which Embree gets a mesh that is shown often once, above 2^19 repeated triangles.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_tiny_stage;

const Surroundings kGround{.background = {}, .environment_file = {}, .ground = true};

/// Returns a mirror ball over rows of balls that are turned, stretched and mirrored. Some balls can
/// be no instances: they are sheared, flat or points. In a flat ball a ray meets two surfaces at
/// once, of which metallic ones look different.
SceneDescription balls(int rings, bool metallic) {
  SceneDescription scene;
  scene.materials = {{.colour = {1, 0.5, 0.2}},
                     {.colour = {0.2, 0.5, 1}, .specular = 0.5},
                     {.colour = {1, 1, 1}, .diffuse = 0.1, .specular = 0.9}};
  if (metallic)
    scene.materials[1].pbr =
        std::make_shared<PbrMaterial>(PbrMaterial{.metallic = 0.9, .roughness = 0.1});
  scene.shapes = {std::make_shared<const TriangleMesh>(test::ball_mesh({5, -3, 2}, 0.4, rings, 0))};
  for (int n = 0; n < 96; ++n) {
    const double c = std::cos(0.3 * n), s = std::sin(0.3 * n);
    const double stretch = 1.0 + 0.1 * (n % 5);
    const double depth = n % 7 == 3 ? -1.0 : n % 24 == 9 && !metallic ? 0.0 : 1.0;
    Affine turn{Vec3{c, s, 0} * stretch, Vec3{-s, c, 0}, Vec3{0, 0, depth}, {}};
    if (n % 24 == 2) turn.column_y = turn.column_y * 0.2 + turn.column_x * 0.7;
    if (n % 24 == 5) turn = {{}, {}, {}, {}};
    turn.origin = Vec3{-3.0 + 0.55 * (n % 12), -2.0 + 0.55 * (n / 12), -0.1 * (n % 9)} -
                  turn.vector({5, -3, 2});
    scene.meshes.push_back({.name = "ball", .material = n % 2, .shape = 0, .place = turn});
  }
  scene.spheres = {{.centre = {0.3, 0.2, 1.2}, .radius = 0.9, .material = 2}};
  Light light;
  light.position = {-3.1, 4.3, 5.2};
  light.colour = {0.9, 0.9, 0.9};
  scene.lights = {light};
  return scene;
}

SceneDescription written_out(const SceneDescription& scene) {
  SceneDescription out = scene;
  out.shapes.clear();
  out.meshes.clear();
  for_each_mesh(scene, [&](const TriangleMesh& mesh) { out.meshes.push_back(mesh); });
  return out;
}

constexpr int kRings = 42, kFewRings = 6;

class Renderer {
 public:
  frames::WovenFrame operator()(const std::string& method, const Scene& scene,
                                const Stage& stage) const {
    frames::WovenFrame frame({rig_.panel.width_px, rig_.panel.height_px});
    EXPECT_TRUE(
        make_method(method, model_, {.cancelled = {}})->render(scene, stage, frame).completed);
    return frame;
  }

 private:
  optics::Rig rig_ = test::make_rig({.width = 300, .height = 200, .pixel_mm = 0.25});
  optics::OpticalModel model_{rig_};
};

class Instances : public ::testing::TestWithParam<std::tuple<bool, std::string>> {};

TEST_P(Instances, ShowTheSceneWrittenOut) {
  const auto& [metallic, method] = GetParam();
  const Stage stage = make_tiny_stage({.turn_degrees = 17.0});
  const SceneDescription scene = balls(kRings, metallic);
  const Scene instances(scene, stage, kGround), copies(written_out(scene), stage, kGround);
  ASSERT_TRUE(instances.embree.has_instances());
  ASSERT_FALSE(copies.embree.has_instances());
  const Renderer render;
  const frames::WovenFrame a = render(method, instances, stage);
  const frames::WovenFrame b = render(method, copies, stage);
  // Rounding differs in the frame of an instance, which shows at edges of surfaces and shadows.
  int other = 0, lit = 0;
  for (int j = 0; j < a.height(); ++j)
    for (int i = 0; i < 3 * a.width(); ++i) {
      other += std::abs(a.row(j)[i] - b.row(j)[i]) > 1 ? 1 : 0;
      lit += b.row(j)[i] > 30 ? 1 : 0;
    }
  EXPECT_LE(other, 3 * a.width() * a.height() / 5000);
  EXPECT_GT(lit, a.width() * a.height() / 2);
}

INSTANTIATE_TEST_SUITE_P(Materials, Instances,
                         ::testing::Combine(::testing::Bool(),
                                            ::testing::Values("full", "adaptive", "lens-view")));

TEST(FewInstances, HaveTheBytesOfTheSceneWrittenOut) {
  const Renderer render;
  const Stage stage = make_tiny_stage();
  for (const bool metallic : {false, true}) {
    const SceneDescription scene = balls(kFewRings, metallic);
    const Scene few(scene, stage, kGround), copies(written_out(scene), stage, kGround);
    EXPECT_FALSE(few.embree.has_instances());
    EXPECT_EQ(render("adaptive", few, stage), render("adaptive", copies, stage));
  }
}

TEST(SmallShapes, AreNoInstances) {
  SceneDescription scene;
  scene.materials = {Material{}};
  scene.shapes = {std::make_shared<const TriangleMesh>(test::box_mesh({0, 0, 0}, {1, 1, 1}, 0))};
  scene.meshes.assign(60'000, {.shape = 0});
  EXPECT_FALSE(Scene(scene, make_tiny_stage(), {}).embree.has_instances());
}

/// Embree ends the process if the numbers of a ray are too large in the frame of an instance.
TEST(ManyInstances, TakeAllRaysThatEmbreeAccepts) {
  SceneDescription scene = balls(50, false);
  for (size_t n = 0; n < 48; ++n) {
    Affine& place = scene.meshes[n].place;
    const Vec3 at = place.point({5, -3, 2});
    place.column_z = place.column_z * std::pow(2.0, -0.5 * static_cast<double>(n));
    place.origin = place.origin + at - place.point({5, -3, 2});
  }
  scene.meshes.insert(scene.meshes.end(), 48, scene.meshes.back());
  const Scene committed(scene, make_tiny_stage(), {});
  ASSERT_TRUE(committed.embree.has_instances());
  constexpr float kMost = 0.999e16F;
  ASSERT_TRUE(embree_accepts(kMost, kMost, kMost));
  for (const float far : {1e10F, kMost})
    for (const float speed : {1e-12F, 1.0F, kMost}) {
      std::vector<PathRay> rays;
      for (const Vec3 from : {Vec3{1, 1, 1}, Vec3{-1, 1, 0.9}, Vec3{0, 1, 0}, Vec3{0.1, -0.2, 1}})
        rays.push_back({.origin = from * far, .direction = from * -speed, .target = 0});
      RayPacket packet;
      ASSERT_EQ(load_packet(rays, packet), 0U);
      RayPacket shadow = packet;
      intersect16(packet.valid, committed.embree, packet.rays, Coherence::Coherent);
      occluded16(shadow.valid, committed.embree, shadow.rays.ray, Coherence::Coherent);
      for (const PathRay& ray : rays) {
        RTCRayHit alone = single_ray(Vec3f(ray.origin), Vec3f(ray.direction), 1e30F);
        intersect1(committed.embree, alone);
      }
    }
}

TEST(SceneKeeper, KeepsInstancesWhileTheStageTurns) {
  const Renderer render;
  const auto scene = std::make_shared<const SceneDescription>(balls(kRings, true));
  SceneKeeper keeper(kGround, 0);
  const RTCScene tree = keeper.commit(scene, make_tiny_stage()).embree.get();
  const Stage turned = make_tiny_stage({.centre = {0.2, 0.1, 0.0}, .turn_degrees = 25.0});
  const Scene& kept = keeper.commit(scene, turned);
  EXPECT_EQ(kept.embree.get(), tree);
  const Scene fresh(*scene, turned, kGround);
  for (const char* method : {"full", "adaptive"})
    EXPECT_EQ(render(method, kept, turned), render(method, fresh, turned)) << method;
}

}  // namespace
}  // namespace lenticule::render
