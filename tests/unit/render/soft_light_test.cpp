// SPDX-License-Identifier: Apache-2.0
// Tests area lights, occlusion and environment light against the reference, and that their bytes do
// not depend on how they are computed.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "base/error.h"
#include "render/options/render_options.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/oracles/reference_renderer.h"
#include "tests/unit/render/soft_light_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

/// Returns all options, in two sets because occlusion and environment exclude each other.
std::vector<SoftLight> kinds() {
  return {{.shadow_samples = 5,
           .light_radius_mm = 13.0,
           .sun_radius_degrees = 4.0,
           .occlusion_samples = 7,
           .occlusion_distance_mm = 11.0},
          {.shadow_samples = 8,
           .light_radius_mm = 25.0,
           .sun_radius_degrees = 2.0,
           .environment_samples = 6}};
}

class SoftLightOfTinyScenes : public ::testing::TestWithParam<test::NamedScene> {};

/// The same samples in double precision: in one of two thousand subpixels, a sample may differ
/// where a ray grazes an edge.
TEST_P(SoftLightOfTinyScenes, AgreesWithTheReference) {
  const optics::Rig rig = make_rig({.width = 40, .height = 26, .pixel_mm = 1.5});
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage({.centre = {0.1, 0.0, -0.2}, .turn_degrees = 13.0});
  int subpixels = 0, different = 0;
  for (const SoftLight& soft : kinds()) {
    const frames::WovenFrame frame = picture(GetParam().scene, rig, stage, with(soft)).frame;
    const frames::WovenFrame hard = picture(GetParam().scene, rig, stage, with({})).frame;
    EXPECT_NE(frame, hard);
    for (int j = 0; j < frame.height(); ++j)
      for (int i = 0; i < frame.width(); ++i)
        for (int c = 0; c < 3; ++c) {
          const double expected =
              test::reference_subpixel(GetParam().scene, stage, model, i, j, c, {.soft = soft});
          ++subpixels;
          if (std::abs(expected - frame.row(j)[3 * i + c]) > 1.0) ++different;
        }
  }
  RecordProperty("different", different);
  std::printf("%s: %d of %d differ\n", GetParam().name.c_str(), different, subpixels);
  EXPECT_LE(different, subpixels / 2000);
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, SoftLightOfTinyScenes,
                         ::testing::ValuesIn(test::tiny_scenes()),
                         [](const auto& scene) { return scene.param.name; });

/// Lights without a size cast hard shadows as before.
TEST_P(SoftLightOfTinyScenes, WithoutSizeOrSamplesHasTheBytesOfHardLight) {
  const optics::Rig rig = make_rig({.width = 100, .height = 60, .pixel_mm = 0.6});
  const frames::WovenFrame hard = picture(GetParam().scene, rig, make_tiny_stage(), {}).frame;
  for (const SoftLight& soft :
       {SoftLight{.shadow_samples = 16, .light_radius_mm = 0.0, .sun_radius_degrees = 0.0},
        SoftLight{.light_radius_mm = 50.0, .sun_radius_degrees = 9.0}})
    EXPECT_EQ(hard, picture(GetParam().scene, rig, make_tiny_stage(), with(soft)).frame);
}

TEST_P(SoftLightOfTinyScenes, HasTheSameBytesForAnyThreadsTilesAndInstructionSet) {
  const optics::Rig rig = make_rig({.width = 150, .height = 40, .pixel_mm = 0.6});
  for (const SoftLight& soft : kinds()) {
    RenderOptions options = with(soft);
    options.samples = 2;
    options.isa = Isa::Baseline;
    const frames::WovenFrame plain =
        picture(GetParam().scene, rig, make_tiny_stage(), options).frame;
    options.threads = 3;
    EXPECT_EQ(plain, picture(GetParam().scene, rig, make_tiny_stage(), options).frame);
    options.tiles_backwards = true;
    for (const Isa isa : test::every_instruction_set()) {
      options.isa = isa;
      EXPECT_EQ(plain, picture(GetParam().scene, rig, make_tiny_stage(), options).frame)
          << isa_name(isa);
    }
  }
}

/// Samples whose visibility is decided by culling are not traced, and nothing else changes.
TEST_P(SoftLightOfTinyScenes, HasTheSameBytesWithoutCulling) {
  const optics::Rig rig = make_rig({.width = 300, .height = 80, .pixel_mm = 0.25});
  for (const double size : {2.0, 15.0}) {
    RenderOptions options = with({.shadow_samples = 4,
                                  .light_radius_mm = size,
                                  .sun_radius_degrees = 0.2 * size,
                                  .occlusion_samples = 4,
                                  .occlusion_distance_mm = size});
    const Picture culled = picture(GetParam().scene, rig, make_tiny_stage(), options);
    options.use_shaft_culling = false;
    const Picture traced = picture(GetParam().scene, rig, make_tiny_stage(), options);
    EXPECT_EQ(culled.frame, traced.frame);
    const RenderStatistics& with_culling = culled.statistics;
    EXPECT_EQ(with_culling.shadow_rays, traced.statistics.shadow_rays);
    EXPECT_EQ(with_culling.ambient_rays, traced.statistics.ambient_rays);
    EXPECT_EQ(traced.statistics.shadow_rays_culled + traced.statistics.shadow_rays_blocked +
                  traced.statistics.ambient_rays_culled,
              0U);
    if (size < 10.0) {
      EXPECT_GT(with_culling.shadow_rays_culled, with_culling.shadow_rays / 30);
      EXPECT_GT(with_culling.ambient_rays_culled, with_culling.ambient_rays / 10);
    }
    const auto percent = [](uint64_t part, uint64_t all) {
      return 100.0 * static_cast<double>(part) / static_cast<double>(all);
    };
    std::printf("%s, %.0f mm: %.0f %% lit, %.0f %% blocked, %.0f %% with nothing around\n",
                GetParam().name.c_str(), size,
                percent(with_culling.shadow_rays_culled, with_culling.shadow_rays),
                percent(with_culling.shadow_rays_blocked, with_culling.shadow_rays),
                percent(with_culling.ambient_rays_culled, with_culling.ambient_rays));
  }
}

TEST(SoftLight, IsRefusedForMetallicRoughnessMaterialsByTheNamesOfItsFlags) {
  SceneDescription scene = wall_and_ball();
  scene.materials.front().pbr = std::make_shared<const PbrMaterial>();
  const optics::Rig rig = make_rig({.width = 12, .height = 8, .pixel_mm = 0.5});
  for (const SoftLight& soft : {only_shadows(4), only_occlusion(4), only_environment(4)}) {
    try {
      static_cast<void>(picture(scene, rig, make_tiny_stage(), with(soft)));
      ADD_FAILURE() << "rendered";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Usage);
      EXPECT_STREQ(error.what(),
                   "--soft-shadows, --occlusion, --environment-light: not supported for "
                   "metallic-roughness materials");
    }
  }
}

/// Points traced by methods that reuse points have the bytes of `full`.
TEST(SoftLight, WorksInMethodsThatReusePoints) {
  const optics::Rig rig = make_rig({.width = 120, .height = 50, .pixel_mm = 0.5});
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  const SoftLight soft = only_shadows(8);
  const Scene scene(wall_and_ball(), stage, {}, 2);
  const Picture full = picture(wall_and_ball(), rig, stage, with(soft));
  for (const char* name : {"lens-view", "temporal"}) {
    RenderOptions options = with(soft);
    options.keep_missing = true;
    frames::WovenFrame one({120, 50}), two({120, 50});
    const auto method = make_method(name, model, options);
    const RenderStatistics statistics = method->render(scene, stage, one);
    options.threads = 2;
    (void)make_method(name, model, options)->render(scene, stage, two);
    EXPECT_EQ(one, two) << name;
    size_t equal = 0;
    for (size_t k = 0; k < one.bytes().size(); ++k)
      equal += one.bytes()[k] == full.frame.bytes()[k] ? 1 : 0;
    EXPECT_GE(equal, statistics.traced_subpixels) << name;
  }
}

TEST(SoftLight, RefusesInvalidOptions) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (const SoftLight& bad :
       {SoftLight{.shadow_samples = -1}, SoftLight{.shadow_samples = 1'000'000},
        SoftLight{.occlusion_samples = -1}, SoftLight{.environment_samples = 5000},
        SoftLight{.light_radius_mm = -1.0}, SoftLight{.light_radius_mm = nan},
        SoftLight{.light_radius_mm = inf}, SoftLight{.sun_radius_degrees = 90.0},
        SoftLight{.sun_radius_degrees = nan}, SoftLight{.occlusion_distance_mm = 0.0},
        SoftLight{.occlusion_distance_mm = nan},
        SoftLight{.occlusion_samples = 1, .environment_samples = 1}}) {
    const optics::OpticalModel model(make_rig({}));
    try {
      (void)make_method("full", model, with(bad));
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Usage);
    }
  }
  EXPECT_NO_THROW(validate({.occlusion_samples = 1, .occlusion_distance_mm = inf}));
}

}  // namespace
}  // namespace lenticule::render
