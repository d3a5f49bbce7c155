// SPDX-License-Identifier: Apache-2.0
// The shadow of models on the ground, against a slow evaluation of its formula and in frames of
// every method.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <random>

#include "frames/srgb.h"
#include "lab/stability/probes.h"
#include "render/methods/method.h"
#include "render/rays/primary_rays.h"
#include "render/scene/surroundings.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/oracles/ground_shadow_oracle.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::OracleGroundShadow;

int add_material(SceneDescription& scene, double alpha) {
  PbrMaterial material;
  material.base_colour = {0.7, 0.5, 0.3};
  material.metallic = 0.0;
  material.double_sided = true;
  material.alpha = alpha;
  if (alpha < 1.0) material.alpha_mode = PbrMaterial::AlphaMode::Blend;
  scene.materials.push_back({.name = "m", .pbr = std::make_shared<PbrMaterial>(material)});
  return static_cast<int>(scene.materials.size()) - 1;
}

/// A box on the ground, its lower side at the given height, with a base of 2 x 1.6 and 1.5 high.
SceneDescription box_scene(double bottom = 0.0) {
  SceneDescription scene;
  scene.source = "test";
  scene.meshes.push_back(
      test::box_mesh({-1.0, bottom, -0.8}, {1.0, bottom + 1.5, 0.8}, add_material(scene, 1.0)));
  return scene;
}

/// A scene with everything that casts shadows in its own way: a box on the ground, a ball above it,
/// a slope, and two veils above each other.
SceneDescription rich_scene() {
  SceneDescription scene;
  scene.source = "test";
  const int solid = add_material(scene, 1.0), veil = add_material(scene, 0.35);
  scene.meshes.push_back(test::box_mesh({-1.713, 0.0, -0.937}, {-0.571, 1.131, 0.419}, solid));
  scene.meshes.push_back(test::ball_mesh({0.513, 0.917, 0.213}, 0.611, 9, solid));
  scene.meshes.push_back(test::rectangle_mesh({-0.317, 0.113, -1.119}, {1.413, 0.0, 0.0},
                                              {0.0, 0.937, -0.819}, solid));
  for (const double y : {0.117, 0.523})
    scene.meshes.push_back(
        test::rectangle_mesh({0.417, y, 0.613}, {1.117, 0.0, 0.213}, {0.119, 0.0, 0.817}, veil));
  return scene;
}

/// Place shows scenes on one rig, from slightly above.
struct Place {
  optics::Rig of = test::make_rig({.width = 160, .height = 100, .pixel_mm = 0.5});
  optics::OpticalModel model{of};

  [[nodiscard]] Stage stage(const SceneDescription& description,
                            const StageOptions& options = {.fill = 0.6}) const {
    Stage stage = make_stage(description, model, options);
    stage.near_mm = std::numeric_limits<double>::infinity();
    return stage;
  }
  [[nodiscard]] frames::WovenFrame frame(const Scene& scene, const Stage& stage,
                                         const std::string& method = "full",
                                         const RenderOptions& options = {},
                                         RenderStatistics* statistics = nullptr) const {
    frames::WovenFrame frame({of.panel.width_px, of.panel.height_px});
    const RenderStatistics done = make_method(method, model, options)->render(scene, stage, frame);
    EXPECT_TRUE(done.completed);
    if (statistics != nullptr) *statistics = done;
    return frame;
  }
  [[nodiscard]] frames::WovenFrame frame(const SceneDescription& description,
                                         const Surroundings& surroundings = {}) const {
    const Stage at = stage(description);
    return frame(Scene(description, at, surroundings, 1), at);
  }
};

double light_left(const Scene& scene, const Stage& stage, Vec3 origin, Vec3 direction) {
  const Affine scene_from_world = scene.scene_from_panel * stage.panel_from_world;
  return scene.backdrop.ground_shadow->light_left(scene_from_world.point(origin),
                                                  scene_from_world.vector(direction));
}

/// Returns the share of the light at a point of the ground.
double light_at(const Scene& scene, const Stage& stage, double x, double z, double ground = 0.0) {
  return light_left(scene, stage, {x, ground + 1.0, z}, {0, -1, 0});
}

TEST(GroundShadow, AgreesWithASlowEvaluation) {
  const Place place;
  for (const double turn : {0.0, 35.0}) {
    for (const SceneDescription& description : {rich_scene(), box_scene()}) {
      const Stage stage = place.stage(description, {.depth_scale = 0.6, .turn_degrees = turn});
      const Scene scene(description, stage, {}, 1);
      ASSERT_TRUE(scene.backdrop.ground_shadow);
      const OracleGroundShadow oracle(description, scene.frame.origin);
      std::mt19937 random(7);
      std::uniform_real_distribution<double> at(-3.0, 3.0), up(0.5, 4.0);
      double darkest = 1.0;
      for (int n = 0; n < 400; ++n) {
        const Vec3 on_ground{at(random), 0.0, at(random)};
        const Vec3 from{at(random), up(random), at(random)};
        const double wanted = oracle.light_left(from, on_ground - from);
        EXPECT_NEAR(light_left(scene, stage, from, on_ground - from), wanted, 1e-4) << n;
        darkest = std::min(darkest, wanted);
      }
      EXPECT_LT(darkest, 0.5);
    }
  }
}

/// Boxes whose edges lie at whole or simple fractions of the distance between the shadow's rays.
TEST(GroundShadow, DoesNotDependOnTheModelsUnit) {
  const Place place;
  for (const Vec3 size : {Vec3{1, 1, 1}, Vec3{2, 1, 2}, Vec3{4, 0.5, 1}, Vec3{1, 1, 0.5}}) {
    for (const bool lamp : {false, true}) {
      const auto frame_at = [&](double unit) {
        SceneDescription scene;
        scene.source = "test";
        const Vec3 half = size * 0.5;
        scene.meshes.push_back(test::box_mesh(half * -unit, half * unit, add_material(scene, 1.0)));
        scene.meshes.push_back(test::box_mesh(half * (0.2 * unit), half * (1.2 * unit),
                                              static_cast<int>(scene.materials.size()) - 1));
        if (lamp)
          scene.lights.push_back({.position = Vec3{1.1, 2.0, 1.3} * unit,
                                  .colour = Vec3{4, 4, 4} * (unit * unit),
                                  .falls_off = true});
        return place.frame(scene);
      };
      const frames::WovenFrame one = frame_at(1.0);
      for (const double unit : {1e-3, 0.01, 0.3, 7.0, 100.0, 1e3}) {
        const frames::WovenFrame other = frame_at(unit);
        int most = 0;
        for (size_t n = 0; n < one.bytes().size(); ++n)
          most = std::max(most, std::abs(int{one.bytes()[n]} - int{other.bytes()[n]}));
        EXPECT_LE(most, 1) << "unit " << unit << ", width " << size.x << ", lamp " << lamp;
      }
    }
  }
}

TEST(GroundShadow, IsFainterUnderAModelThatHasLeftTheGround) {
  const Place place;
  const SceneDescription standing = box_scene();
  Stage stage = place.stage(standing);
  const double size = std::cbrt(2.0 * 1.6 * 1.5);
  stage.ground = Ground{.y = 0.0, .size = size};
  double last = 0.0;
  for (const double height : {0.0, 0.1, 0.5, 1.0}) {
    const Scene scene(box_scene(height), stage, {}, 1);
    const double light = light_at(scene, stage, 0.0, 0.0);
    EXPECT_NEAR(light,
                1.0 - 0.45 * std::pow(std::max(0.0, 1 - height / (0.25 * size)), 2) -
                    0.45 * std::pow(1 - height / (1.5 * size), 2),
                0.01);
    EXPECT_GT(light, last);
    last = light;
  }
  // Without the ground of another moment the ground is under the model.
  stage.ground.reset();
  const Scene scene(box_scene(1.0), stage, {}, 1);
  EXPECT_NEAR(light_at(scene, stage, 0.0, 0.0, 1.0), 0.1, 0.01);
}

TEST(GroundShadow, FallsInTheStudioAlone) {
  const Place place;
  const auto has_shadow = [&](const SceneDescription& description,
                              const Surroundings& surroundings) {
    const Scene scene(description, place.stage(description), surroundings, 1);
    EXPECT_EQ(scene.backdrop.flat(), !surroundings.sky && scene.backdrop.ground_shadow == nullptr);
    return scene.backdrop.ground_shadow != nullptr;
  };
  const SceneDescription model = box_scene();
  EXPECT_TRUE(has_shadow(model, {}));
  EXPECT_TRUE(has_shadow(model, {.background = Vec3{1, 1, 1}}));
  EXPECT_FALSE(has_shadow(model, {.ground_shadow = false}));
  EXPECT_FALSE(has_shadow(model, {.ground = true}));
  EXPECT_FALSE(has_shadow(model, {.sky = true}));
  SceneDescription lit = model;
  lit.lights.push_back({.position = {0, 9, 0}});
  EXPECT_FALSE(has_shadow(lit, {}));
  SceneDescription ambient = model;
  ambient.ambient = Vec3{0.5, 0.5, 0.5};
  EXPECT_FALSE(has_shadow(ambient, {}));
  SceneDescription whitted = model;
  whitted.materials = {{.name = "plain"}};
  EXPECT_FALSE(has_shadow(whitted, {}));
  whitted.lit_by_studio = true;
  EXPECT_TRUE(has_shadow(whitted, {}));
}

TEST(GroundShadow, IsNotSeenFromBelow) {
  const Place place;
  const SceneDescription description = box_scene();
  const Surroundings without{.ground_shadow = false};
  for (const double pitch : {-30.0, 12.0, 30.0, 80.0}) {
    const Stage stage = place.stage(description, {.fill = 0.6, .pitch_degrees = pitch});
    const bool same = place.frame(Scene(description, stage, {}, 1), stage) ==
                      place.frame(Scene(description, stage, without, 1), stage);
    EXPECT_EQ(same, pitch < 0.0) << pitch;
  }
}

/// Every subpixel beside the model shows the background times the light that is left.
TEST(GroundShadow, DarkensTheBackgroundBesideTheModelAsTheFormulaSays) {
  const Place place;
  const SceneDescription description = rich_scene();
  const Stage stage = place.stage(description);
  const Scene scene(description, stage, {}, 1);
  const frames::WovenFrame with = place.frame(scene, stage);
  const frames::WovenFrame without = place.frame(description, {.ground_shadow = false});
  const int plain = frames::code_from_linear(kStudioBackground.x);
  const OracleGroundShadow oracle(description, scene.frame.origin);
  const TilePlan plan(place.of);
  const PrimaryRays rays(place.model, plan);
  const Footprint centre(place.model, {});
  optics::RowRays scratch;
  const Affine world_from_scene = stage.world_from_panel * scene.scene_from_panel.inverse();
  int beside = 0, dark = 0;
  for (int row = 0; row < with.height(); ++row)
    for (int n = 0; n < 3 * with.width(); ++n) {
      const int code = with.row(row)[n];
      PathRay ray = rays.one(scene, row, n, centre, scratch);
      ray.target = 0;
      std::array<Hit, 1> hit;
      lab::intersect(scene.embree, {&ray, 1}, Coherence::Coherent, hit);
      if (hit[0].geometry != Hit::kMiss) continue;
      const double light = oracle.light_left(world_from_scene.point(ray.origin),
                                             world_from_scene.vector(ray.direction));
      EXPECT_NEAR(code, frames::code_from_linear(kStudioBackground.x * light), 1)
          << row << ", " << n;
      EXPECT_EQ(without.row(row)[n], plain);
      ++beside;
      dark += code < plain - 20 ? 1 : 0;
    }
  EXPECT_GT(beside, 10000);
  EXPECT_GT(dark, 500);
}

TEST(GroundShadow, HasTheSameBytesWithAnyThreadsInstructionSetAndCulling) {
  const Place place;
  const SceneDescription description = rich_scene();
  const Stage stage = place.stage(description);
  for (const char* method : {"full", "adaptive"}) {
    const auto frame = [&](const RenderOptions& options) {
      // Embree limits the threads of the process to those that commit a scene.
      const Scene scene(description, stage, {}, options.threads);
      return place.frame(scene, stage, method, options);
    };
    const frames::WovenFrame one = frame({.threads = 1, .cancelled = {}});
    EXPECT_EQ(one, frame({.threads = 3, .cancelled = {}}));
    for (const Isa isa : test::every_instruction_set())
      EXPECT_EQ(one, frame({.threads = 1, .isa = isa, .cancelled = {}}));
    if (method == std::string("full")) {
      EXPECT_EQ(one, frame({.threads = 1, .skip_background = false, .cancelled = {}}));
    }
  }
}

double share_beyond(const frames::WovenFrame& a, const frames::WovenFrame& b, double error) {
  size_t beyond = 0;
  for (size_t n = 0; n < a.bytes().size(); ++n)
    beyond += std::abs(int{a.bytes()[n]} - int{b.bytes()[n]}) > error ? 1 : 0;
  return static_cast<double>(beyond) / static_cast<double>(a.bytes().size());
}

TEST(GroundShadow, KeepsTheBoundOfMethodAdaptive) {
  const Place place;
  uint64_t interpolated = 0;
  for (const SceneDescription& description : {rich_scene(), box_scene()}) {
    const Stage stage = place.stage(description);
    const Scene scene(description, stage, {}, 1);
    const frames::WovenFrame full = place.frame(scene, stage);
    for (const double error : {0.5, 1.0, 2.0}) {
      RenderStatistics s;
      const frames::WovenFrame adaptive =
          place.frame(scene, stage, "adaptive", {.tolerated_error = error, .cancelled = {}}, &s);
      EXPECT_LE(share_beyond(full, adaptive, error), s.audited_subpixels > 0 ? s.beyond_bound : 0.0)
          << error;
      interpolated += s.interpolated_subpixels;
    }
  }
  EXPECT_GT(interpolated, 0U);
}

/// The methods that reuse points of neighbouring lenses take the background for infinitely far
/// away.
TEST(GroundShadow, IsNearlyTheSameInTheMethodsThatReusePoints) {
  const Place place;
  const SceneDescription description = box_scene();
  const Stage stage = place.stage(description);
  const Scene scene(description, stage, {}, 1);
  const frames::WovenFrame full = place.frame(scene, stage);
  for (const char* method : {"lens-view", "interpolate", "temporal", "hybrid"})
    EXPECT_LT(share_beyond(full, place.frame(scene, stage, method), 2.0), 0.01) << method;
}

TEST(GroundShadow, IsSeenThroughWhatLetsLightPass) {
  const Place place;
  SceneDescription description = rich_scene();
  const frames::WovenFrame plain = place.frame(description);
  description.meshes.push_back(test::rectangle_mesh({-1.6, 0.02, 0.9}, {1.9, 0, 0}, {0, 1, 0},
                                                    add_material(description, 0.0)));
  EXPECT_EQ(share_beyond(place.frame(description), plain, 1.0), 0.0);
}

}  // namespace
}  // namespace lenticule::render
