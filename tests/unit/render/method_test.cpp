// SPDX-License-Identifier: Apache-2.0
#include "render/methods/method.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

frames::WovenFrame blank(const optics::Rig& rig) {
  return frames::WovenFrame({rig.panel.width_px, rig.panel.height_px});
}

frames::WovenFrame rendered(const SceneDescription& description, const optics::Rig& rig,
                            const Stage& stage, const RenderOptions& options = {},
                            const Surroundings& surroundings = {}) {
  const optics::OpticalModel model(rig);
  const Scene scene(description, stage, surroundings, options.threads);
  frames::WovenFrame frame = blank(rig);
  EXPECT_TRUE(make_method("full", model, options)->render(scene, stage, frame).completed);
  return frame;
}

TEST(MakeMethod, KnowsItsNames) {
  const optics::OpticalModel model(make_rig({}));
  for (const std::string& name : method_names()) EXPECT_NE(make_method(name, model, {}), nullptr);
  try {
    (void)make_method("magic", model, {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    EXPECT_NE(std::string(error.hint()).find("full"), std::string::npos);
  }
}

TEST(MakeMethod, RefusesOptionsOutOfRange) {
  const optics::OpticalModel model(make_rig({}));
  for (const RenderOptions& options :
       {RenderOptions{.threads = -1, .cancelled = {}}, RenderOptions{.samples = 0, .cancelled = {}},
        RenderOptions{.samples = 1'000'000, .cancelled = {}},
        RenderOptions{.max_depth = -1, .cancelled = {}}})
    EXPECT_THROW((void)make_method("full", model, options), Error);
}

/// The picture must not depend on the distribution of work to threads.
TEST(MethodFull, GivesTheSameBytesWithAnyNumberOfThreads) {
  const optics::Rig rig = make_rig({.width = 150, .height = 70, .pixel_mm = 0.5});
  for (const test::NamedScene& named : test::tiny_scenes())
    for (const int samples : {1, 3}) {
      const frames::WovenFrame one = rendered(named.scene, rig, make_tiny_stage(),
                                              {.threads = 1, .samples = samples, .cancelled = {}});
      for (const int threads : {2, 8})
        EXPECT_EQ(one, rendered(named.scene, rig, make_tiny_stage(),
                                {.threads = threads, .samples = samples, .cancelled = {}}))
            << named.name << " with " << threads << " threads";
    }
}

/// Covers our own loops; Embree always uses the machine's best set.
TEST(MethodFull, GivesTheSameBytesWithEveryInstructionSet) {
  const optics::Rig rig = make_rig({.width = 150, .height = 70, .pixel_mm = 0.5});
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const auto with = [&](Isa isa) {
      return rendered(named.scene, rig, make_tiny_stage(),
                      {.threads = 1, .isa = isa, .cancelled = {}});
    };
    const frames::WovenFrame plain = with(Isa::Baseline);
    for (const Isa isa : {Isa::Avx2, Isa::Avx512})
      EXPECT_EQ(plain, with(isa)) << named.name << ", " << isa_name(isa);
  }
}

/// Rays that provably hit nothing are not traced, and nothing else changes.
TEST(MethodFull, GivesTheSameBytesWithoutSkippingEmptyShafts) {
  const optics::Rig rig = make_rig({.width = 300, .height = 140, .pixel_mm = 0.25});
  const optics::OpticalModel model(rig);
  uint64_t culled_shadow = 0, culled_secondary = 0;
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const Stage stage = make_tiny_stage();
    const Scene scene(named.scene, stage, {});
    frames::WovenFrame skipped = blank(rig), traced = blank(rig);
    const auto render = [&](bool skip, frames::WovenFrame& frame) {
      return make_method("full", model, {.use_shaft_culling = skip, .cancelled = {}})
          ->render(scene, stage, frame);
    };
    const RenderStatistics with = render(true, skipped);
    const RenderStatistics without = render(false, traced);
    EXPECT_EQ(skipped, traced) << named.name;
    EXPECT_EQ(with.shadow_rays, without.shadow_rays);
    EXPECT_EQ(with.secondary_rays, without.secondary_rays);
    EXPECT_EQ(without.shadow_rays_culled + without.secondary_rays_culled, 0U);
    culled_shadow += with.shadow_rays_culled;
    culled_secondary += with.secondary_rays_culled;
  }
  EXPECT_GT(culled_shadow, 10000U);
  EXPECT_GT(culled_secondary, 1000U);
}

/// Rays that cannot change a code value are skipped, and nothing else changes.
TEST(MethodFull, GivesTheSameBytesWithoutSkippingWeakRays) {
  const optics::Rig rig = make_rig({.width = 300, .height = 140, .pixel_mm = 0.25});
  const optics::OpticalModel model(rig);
  uint64_t left_out = 0;
  for (const bool managed : {false, true})
    for (test::NamedScene named : test::tiny_scenes()) {
      named.scene.colour_managed = managed;
      for (Material& material : named.scene.materials) material.specular *= 0.1;
      const Stage stage = make_tiny_stage();
      const Scene scene(named.scene, stage, {});
      frames::WovenFrame all = blank(rig), fewer = blank(rig);
      const auto render = [&](bool skip, frames::WovenFrame& frame) {
        return make_method("full", model,
                           {.max_depth = 12, .skip_weak_rays = skip, .cancelled = {}})
            ->render(scene, stage, frame);
      };
      EXPECT_EQ(render(false, all).secondary_rays_too_weak, 0U);
      left_out += render(true, fewer).secondary_rays_too_weak;
      EXPECT_EQ(all, fewer) << named.name << (managed ? ", managed" : "");
    }
  EXPECT_GT(left_out, 1000U);
}

TEST(MethodFull, FillsTheFrameOfAnEmptySceneWithBackground) {
  SceneDescription empty;
  empty.background = {1.0, 0.2, 0.0};
  empty.colour_managed = false;
  const frames::WovenFrame frame =
      rendered(empty, make_rig({.width = 37, .height = 19}), make_tiny_stage());
  for (int j = 0; j < frame.height(); ++j)
    for (int i = 0; i < frame.width(); ++i) {
      ASSERT_EQ(frame.row(j)[3 * i], 255);
      ASSERT_EQ(frame.row(j)[3 * i + 1], 51);
      ASSERT_EQ(frame.row(j)[3 * i + 2], 0);
    }
}

TEST(MethodFull, EncodesColourManagedScenesOnly) {
  SceneDescription empty;
  empty.background = {0.5, 0.5, 0.5};
  EXPECT_EQ(rendered(empty, make_rig({}), make_tiny_stage()).row(0)[0], 188);
  empty.colour_managed = false;
  EXPECT_EQ(rendered(empty, make_rig({}), make_tiny_stage()).row(0)[0], 128);
}

/// All eyes see a plane in the panel's plane at the same place: the picture is the texture, not a
/// blend.
TEST(MethodFull, ContentInThePanelsPlaneIsTheSameFromEveryView) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{1, 1, 1};
  scene.materials = {Material{.name = "left", .colour = {1, 1, 1}},
                     Material{.name = "right", .colour = {0, 0, 0}}};
  scene.meshes = {test::rectangle_mesh({-50, -50, 0}, {50, 0, 0}, {0, 100, 0}, 0),
                  test::rectangle_mesh({0, -50, 0}, {50, 0, 0}, {0, 100, 0}, 1)};
  const optics::Rig rig = make_rig({.width = 90, .height = 30, .pixel_mm = 1.0});
  const frames::WovenFrame frame = rendered(scene, rig, make_tiny_stage({.mm_per_unit = 1.0}));
  // More than a lens away from the edge, left is white and right is black in all channels.
  const int margin = 6;
  for (int j = 0; j < frame.height(); ++j)
    for (int i = 0; i < frame.width(); ++i)
      for (int c = 0; c < 3; ++c) {
        if (std::abs(i - 45) <= margin) continue;
        ASSERT_EQ(frame.row(j)[3 * i + c], i < 45 ? 255 : 0);
      }
}

/// Supersampling smooths edges and keeps uniform areas.
TEST(MethodFull, SamplesSmoothEdgesOnly) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{1, 1, 1};
  scene.materials = {Material{}};
  scene.spheres = {{.centre = {0, 0, 0}, .radius = 2}};
  const optics::Rig rig = make_rig({.width = 48, .height = 32, .pixel_mm = 1.0});
  const frames::WovenFrame single = rendered(scene, rig, make_tiny_stage());
  const frames::WovenFrame many =
      rendered(scene, rig, make_tiny_stage(), {.samples = 16, .cancelled = {}});
  int grey = 0;
  for (size_t k = 0; k < single.bytes().size(); ++k) {
    ASSERT_TRUE(single.bytes()[k] == 0 || single.bytes()[k] == 255);
    if (many.bytes()[k] != 0 && many.bytes()[k] != 255) ++grey;
  }
  EXPECT_GT(grey, 100);
  EXPECT_LT(grey, static_cast<int>(single.bytes().size()) / 4);
}

TEST(MethodFull, DepthZeroHasNoReflections) {
  SceneDescription scene;
  scene.materials = {Material{.diffuse = 0.0, .specular = 1.0}};
  scene.background = {0.3, 0.3, 0.3};
  scene.ambient = Vec3{};
  scene.meshes = {test::rectangle_mesh({-50, -50, 0}, {100, 0, 0}, {0, 100, 0}, 0)};
  const optics::Rig rig = make_rig({});
  EXPECT_EQ(rendered(scene, rig, make_tiny_stage(), {.max_depth = 0, .cancelled = {}}).row(3)[7],
            0);
  EXPECT_GT(rendered(scene, rig, make_tiny_stage(), {.max_depth = 1, .cancelled = {}}).row(3)[7],
            0);
}

}  // namespace
}  // namespace lenticule::render
