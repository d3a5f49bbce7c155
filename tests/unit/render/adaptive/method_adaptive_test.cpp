// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/error.h"
#include "render/methods/adaptive/audit.h"
#include "render/methods/method.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

/// Returns a rig large enough for most subpixels to lie between samples.
optics::Rig wide_rig() { return make_rig({.width = 400, .height = 240, .pixel_mm = 0.2}); }

struct Rendered {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

Rendered rendered(const std::string& method, const SceneDescription& description,
                  const optics::Rig& rig, const RenderOptions& options = {},
                  const Surroundings& surroundings = {}) {
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  // Embree limits the threads of the process to those that commit the scene.
  const Scene scene(description, stage, surroundings, options.threads);
  Rendered out{frames::WovenFrame({rig.panel.width_px, rig.panel.height_px}), {}};
  out.statistics = make_method(method, model, options)->render(scene, stage, out.frame);
  EXPECT_TRUE(out.statistics.completed);
  return out;
}

struct Difference {
  double psnr = 0.0;
  double beyond = 0.0;   ///< share off by more than two codes
  double far_off = 0.0;  ///< share off by more than eight codes
};

Difference compare(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  double squares = 0.0, beyond = 0.0, far_off = 0.0;
  const auto count = static_cast<double>(a.bytes().size());
  for (size_t n = 0; n < a.bytes().size(); ++n) {
    const int off = std::abs(int{a.bytes()[n]} - int{b.bytes()[n]});
    squares += off * off;
    beyond += off > 2 ? 1.0 : 0.0;
    far_off += off > 8 ? 1.0 : 0.0;
  }
  return {.psnr = 10.0 * std::log10(255.0 * 255.0 * count / std::max(squares, 1e-9)),
          .beyond = beyond / count,
          .far_off = far_off / count};
}

TEST(MethodAdaptive, IsCloseToFullOnEveryScene) {
  uint64_t interpolated = 0, shaded = 0;
  for (const bool managed : {false, true})
    for (test::NamedScene named : test::tiny_scenes()) {
      named.scene.colour_managed = managed;
      const Rendered full = rendered("full", named.scene, wide_rig());
      const Rendered adaptive = rendered("adaptive", named.scene, wide_rig());
      const Difference off = compare(full.frame, adaptive.frame);
      const RenderStatistics& s = adaptive.statistics;
      EXPECT_GT(off.psnr, 44.0) << named.name << managed;
      EXPECT_LT(off.far_off, 0.004) << named.name << managed;
      EXPECT_LE(off.beyond, s.beyond_bound) << named.name << managed;
      EXPECT_EQ(s.interpolated_subpixels + s.traced_subpixels, s.subpixels);
      if (s.interpolated_subpixels > 0) {
        EXPECT_GT(s.audited_subpixels, s.subpixels / 1000);
      }
      interpolated += s.interpolated_subpixels;
      shaded += s.traced_subpixels;
    }
  EXPECT_GT(interpolated, shaded);
}

/// Returns spheres that are smaller than the distances of the samples, in a loose heap.
SceneDescription heap_of_beads() {
  SceneDescription scene = test::tiny_scenes().front().scene;
  scene.spheres.clear();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-2.0, 2.0);
  for (int n = 0; n < 4000; ++n)
    scene.spheres.push_back(
        {.centre = {place(random), place(random), place(random)}, .radius = 0.03, .material = 0});
  return scene;
}

TEST(MethodAdaptive, LeavesAFrameOfSmallSurfacesToFullAndCopiesItWhileNothingMoves) {
  const optics::Rig rig = make_rig({.width = 1600, .height = 960, .pixel_mm = 0.05});
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  const Scene scene(heap_of_beads(), stage, {}, 1);
  const auto method = make_method("adaptive", model, {.copy_unchanged = true, .cancelled = {}});
  frames::WovenFrame frame({1600, 960});
  const RenderStatistics first = method->render(scene, stage, frame);
  EXPECT_EQ(first.interpolated_subpixels, 0U);
  EXPECT_EQ(first.audited_subpixels, 0U) << "no band was tried";
  EXPECT_EQ(frame, rendered("full", heap_of_beads(), rig).frame);
  const RenderStatistics again = method->render(scene, stage, frame);
  EXPECT_EQ(again.copied_subpixels, again.subpixels);
}

TEST(MethodAdaptive, WithZeroErrorHasTheBytesOfFull) {
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const RenderOptions exact{.tolerated_error = 0.0, .cancelled = {}};
    EXPECT_EQ(rendered("full", named.scene, wide_rig()).frame,
              rendered("adaptive", named.scene, wide_rig(), exact).frame)
        << named.name;
  }
}

/// More threads work on more bands at the same time, and on parts of them in another order.
TEST(MethodAdaptive, GivesTheSameBytesForAnyThreadsTilesAndInstructionSet) {
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const Rendered one =
        rendered("adaptive", named.scene, wide_rig(), {.threads = 1, .cancelled = {}});
    const auto same = [&](const RenderOptions& options) {
      const Rendered other = rendered("adaptive", named.scene, wide_rig(), options);
      EXPECT_EQ(one.frame, other.frame) << named.name;
      const RenderStatistics &a = one.statistics, &b = other.statistics;
      EXPECT_EQ(a.traced_subpixels, b.traced_subpixels) << named.name;
      EXPECT_EQ(a.retraced_subpixels, b.retraced_subpixels) << named.name;
      EXPECT_EQ(a.shadow_rays + a.secondary_rays, b.shadow_rays + b.secondary_rays) << named.name;
    };
    same({.threads = 3, .cancelled = {}});
    same({.threads = 8, .tiles_backwards = true, .cancelled = {}});
    for (const Isa isa : test::every_instruction_set())
      same({.threads = 1, .isa = isa, .cancelled = {}});
  }
}

/// The method requests culling tests depending on their success so far; weak rays are skipped
/// whether or not a test was available.
TEST(MethodAdaptive, CullingDoesNotChangeTheBytesOfSoftLight) {
  for (test::NamedScene& named : test::tiny_scenes()) {
    // Reflections contribute one code value at most.
    named.scene.background = {1.0, 1.0, 1.0};
    for (Material& material : named.scene.materials) material.specular = 0.0035;
    const SoftLight around{.occlusion_samples = 4, .occlusion_distance_mm = 10.0};
    SoftLight of_area_lights = around;
    of_area_lights.shadow_samples = 16;
    of_area_lights.light_radius_mm = 6.0;
    for (const SoftLight& soft : {around, of_area_lights}) {
      const RenderOptions with{.threads = 1, .soft = soft, .cancelled = {}};
      RenderOptions without = with, otherwise = with;
      without.use_shaft_culling = false;
      otherwise.threads = 3;
      otherwise.tiles_backwards = true;
      const Rendered one = rendered("adaptive", named.scene, wide_rig(), with);
      EXPECT_EQ(one.frame, rendered("adaptive", named.scene, wide_rig(), without).frame)
          << named.name;
      EXPECT_EQ(one.frame, rendered("adaptive", named.scene, wide_rig(), otherwise).frame)
          << named.name;
    }
  }
}

/// Residual maps, parallel zones, wide lobes and unusual orders of subpixels.
TEST(MethodAdaptive, IsCloseToFullOnEveryKindOfRig) {
  std::vector<optics::Rig> rigs = {
      make_rig({.width = 300, .height = 160, .pitch_subpx = 24.0, .slant = 0.0, .pixel_mm = 0.25}),
      make_rig({.width = 300,
                .height = 160,
                .distance_mm = std::numeric_limits<double>::infinity(),
                .pixel_mm = 0.25}),
      make_rig({.width = 300, .height = 160, .slant = -0.6, .eye_height_mm = 90, .pixel_mm = 0.25}),
      make_rig({.width = 300, .height = 160, .layout = "cells", .pixel_mm = 0.25})};
  rigs.push_back(rigs.front());
  std::mt19937_64 random(5);
  rigs.back().sheet.residual = test::random_residual(random, 2, 2, 0.04);
  rigs.push_back(rigs.front());
  rigs.back().panel.layout = optics::SubpixelLayout::bgr();
  const test::NamedScene named = test::tiny_scenes().front();
  for (const optics::Rig& rig : rigs) {
    const Difference off = compare(rendered("full", named.scene, rig).frame,
                                   rendered("adaptive", named.scene, rig).frame);
    EXPECT_GT(off.psnr, 42.0);
    EXPECT_LT(off.far_off, 0.005);
  }
}

TEST(MethodAdaptive, ShowsSkiesAndEmptyScenesAsFullDoes) {
  SceneDescription empty;
  empty.background = {1.0, 0.2, 0.0};
  for (const bool sky : {false, true}) {
    Surroundings surroundings;
    surroundings.sky = sky;
    const Difference off = compare(rendered("full", empty, wide_rig(), {}, surroundings).frame,
                                   rendered("adaptive", empty, wide_rig(), {}, surroundings).frame);
    EXPECT_EQ(off.beyond, 0.0);
    EXPECT_GT(off.psnr, 60.0);
  }
}

/// Returns a sheet in the panel's plane with nearly as many stripes as there are rows of samples,
/// so that each row of samples sees one shade.
SceneDescription finely_striped(const optics::Rig& rig) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{1, 1, 1};
  // The reflections are below the tolerated error, but retraced subpixels show them.
  scene.materials = {
      Material{.name = "paper", .colour = {1, 1, 1}, .specular = 0.003, .texture = 0}};
  scene.background = {1, 1, 1};
  auto stripes = std::make_shared<Texture>();
  stripes->width = 1;
  stripes->height = rig.panel.height_px;
  for (int n = 0; n < stripes->height; ++n)
    for (int c = 0; c < 4; ++c) stripes->rgba.push_back(n % 4 == 1 || n % 4 == 3 ? 0.2F : 0.9F);
  scene.textures = {stripes};
  const double width = rig.panel.width_px * rig.panel.pixel_width.value;
  const double height = rig.panel.height_px * rig.panel.pixel_height.value;
  TriangleMesh sheet =
      test::rectangle_mesh({-width / 2, -height / 2, 0}, {width, 0, 0}, {0, height, 0}, 0);
  for (const Vec3& p : sheet.positions)
    sheet.uvs.push_back(
        {static_cast<float>(p.x / width + 0.5), static_cast<float>(0.5 - p.y / height)});
  scene.meshes = {sheet};
  return scene;
}

struct Pair {
  frames::WovenFrame full, adaptive;
  RenderStatistics statistics;  ///< statistics of adaptive
};

Pair rendered_striped(const optics::Rig& rig) {
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage({.mm_per_unit = 1.0});
  const Scene committed(finely_striped(rig), stage, {}, 1);
  const frames::FrameGeometry geometry{rig.panel.width_px, rig.panel.height_px};
  Pair out{frames::WovenFrame(geometry), frames::WovenFrame(geometry), {}};
  (void)make_method("full", model, {})->render(committed, stage, out.full);
  out.statistics = make_method("adaptive", model, {})->render(committed, stage, out.adaptive);
  return out;
}

/// Samples a few pixels apart miss such detail: the audit detects it.
TEST(MethodAdaptive, RetracesDetailMissedBySamples) {
  const auto [full, adaptive, s] = rendered_striped(wide_rig());
  const Difference off = compare(full, adaptive);
  EXPECT_LE(off.beyond, s.beyond_bound);
  EXPECT_LT(off.beyond, 0.08);
  EXPECT_EQ(s.interpolated_subpixels, 0U);
  EXPECT_EQ(full, adaptive);
}

TEST(MethodAdaptive, FallsBackToFullIfMostBandsWouldBeRetraced) {
  const auto [full, adaptive, s] =
      rendered_striped(make_rig({.width = 120, .height = 640, .pixel_mm = 0.2}));
  EXPECT_EQ(full, adaptive);
  EXPECT_TRUE(s.completed);
  EXPECT_EQ(s.traced_subpixels, s.subpixels);
  EXPECT_EQ(s.retraced_subpixels, 0U);
}

/// Soft light is a noisy sum of samples: the ground truth is full with many samples.
TEST(MethodAdaptive, SoftLightIsAsAccurateAsFulls) {
  const auto with = [](int samples) {
    return RenderOptions{.soft = {.shadow_samples = samples,
                                  .light_radius_mm = 8.0,
                                  .occlusion_samples = samples,
                                  .occlusion_distance_mm = 20.0},
                         .cancelled = {}};
  };
  const optics::Rig rig = make_rig({.width = 240, .height = 140, .pixel_mm = 0.33});
  std::vector<test::NamedScene> scenes = test::tiny_scenes();
  scenes.resize(3);
  for (const test::NamedScene& named : scenes) {
    const frames::WovenFrame ground_truth = rendered("full", named.scene, rig, with(128)).frame;
    const Rendered full = rendered("full", named.scene, rig, with(16));
    const Rendered adaptive = rendered("adaptive", named.scene, rig, with(16));
    const double full_psnr = compare(ground_truth, full.frame).psnr;
    const Difference off = compare(ground_truth, adaptive.frame);
    EXPECT_GT(off.psnr, std::min(full_psnr, 44.0) - 1.0) << named.name;
    EXPECT_LE(off.beyond, adaptive.statistics.beyond_bound + 0.01) << named.name;
    EXPECT_EQ(adaptive.frame, rendered("adaptive", named.scene, rig, with(16)).frame);
  }
}

/// Green decides about the light's path, and these surfaces reflect no green.
TEST(MethodAdaptive, LightsSurfacesOfASinglePrimaryColourSoftly) {
  for (const Vec3 colour : {Vec3{0.9, 0, 0}, Vec3{0, 0, 0.9}}) {
    SceneDescription scene = test::tiny_scenes().front().scene;
    for (Material& material : scene.materials) material.colour = colour;
    scene.ambient = {0.5, 0.5, 0.5};
    const RenderOptions options{.soft = {.shadow_samples = 16,
                                         .light_radius_mm = 8.0,
                                         .occlusion_samples = 16,
                                         .occlusion_distance_mm = 20.0},
                                .cancelled = {}};
    const frames::WovenFrame full = rendered("full", scene, wide_rig(), options).frame;
    const Rendered adaptive = rendered("adaptive", scene, wide_rig(), options);
    EXPECT_EQ(adaptive.statistics.retraced_subpixels, 0U);
    EXPECT_GT(compare(full, adaptive.frame).psnr, 42.0);
  }
}

/// Embree accepts no ray of a stage that is squeezed too flat: subpixels are black, not background.
TEST(MethodAdaptive, AgreesWithFullForUnusableRays) {
  const optics::Rig rig = make_rig({.width = 120, .height = 60, .pixel_mm = 0.6});
  const optics::OpticalModel model(rig);
  SceneDescription description = test::tiny_scenes().front().scene;
  description.background = {0.2, 0.5, 0.7};
  for (const double depth_scale : {1e-20, 3e-17, 1e-15, 1e-3}) {
    const Stage stage = make_tiny_stage({.depth_scale = depth_scale});
    const Scene scene(description, stage, {}, 1);
    frames::WovenFrame full({rig.panel.width_px, rig.panel.height_px}), adaptive = full;
    const auto render = [&](const char* name, frames::WovenFrame& frame) {
      return make_method(name, model, {})->render(scene, stage, frame);
    };
    const uint64_t invalid = render("full", full).invalid_rays;
    EXPECT_EQ(render("adaptive", adaptive).invalid_rays, invalid) << depth_scale;
    EXPECT_EQ(invalid, depth_scale < 1e-18 ? full.bytes().size() : 0U) << depth_scale;
    if (depth_scale < 1e-16) {
      EXPECT_EQ(adaptive, full) << depth_scale;
    } else {
      EXPECT_GT(compare(full, adaptive).psnr, 33.0) << depth_scale;
    }
  }
}

/// Returns a scene like a fence: wires thinner than the distance of samples, and their shadows on a
/// wall. Lookups lose wires; few subpixels are wrong, but by much.
SceneDescription wires(double gap) {
  SceneDescription scene = test::tiny_scenes()[1].scene;
  scene.cones.clear();
  for (double x = -6.0; x < 6.0; x += gap) {
    Cone wire;
    wire.material = 2;
    wire.base = {x, -4.0, 0.0};
    wire.apex = {x + 0.7, 4.0, 0.3};
    wire.base_radius = wire.apex_radius = 0.006;
    scene.cones.push_back(wire);
  }
  return scene;
}

TEST(MethodAdaptive, KeepsThePromisedPsnrWhereThinObjectsAreMissed) {
  for (const double gap : {0.15, 0.6, 2.5}) {
    const SceneDescription scene = wires(gap);
    const Rendered full = rendered("full", scene, wide_rig());
    for (const double db : {25.0, 32.0, 39.0}) {
      RenderOptions options;
      promise_psnr(db, options);
      const Rendered adaptive = rendered("adaptive", scene, wide_rig(), options);
      const RenderStatistics& s = adaptive.statistics;
      EXPECT_GE(compare(full.frame, adaptive.frame).psnr, db) << gap;
      EXPECT_LE(s.rmse_bound, options.proven_rmse) << gap << ", " << db;
      EXPECT_LE(s.audited_rmse, s.rmse_bound);
    }
  }
}

TEST(MethodAdaptive, BandsThatWereNotTriedCountAsExactInTheProof) {
  SceneDescription scene = wires(0.04);
  for (Cone& wire : scene.cones) wire.apex = wire.base + Vec3{0.0, 4.0, 0.0};
  const optics::Rig rig = make_rig({.width = 400, .height = 960, .pixel_mm = 0.05});
  const Rendered full = rendered("full", scene, rig);
  RenderOptions options;
  promise_psnr(40.0, options);
  const Rendered adaptive = rendered("adaptive", scene, rig, options);
  const RenderStatistics& s = adaptive.statistics;
  EXPECT_GT(s.retraced_subpixels, 0U);
  EXPECT_LT(s.retraced_subpixels, s.subpixels);
  EXPECT_GE(compare(full.frame, adaptive.frame).psnr, 40.0);
  EXPECT_LE(s.rmse_bound, options.proven_rmse);
  EXPECT_NEAR(static_cast<double>(s.audited_subpixels),
              static_cast<double>(s.subpixels) / sampled_one_in_for(6.5, s.subpixels),
              0.1 * static_cast<double>(s.audited_subpixels));
}

TEST(MethodAdaptive, StatesNoErrorIfEveryBandComesFromFull) {
  RenderOptions options;
  promise_psnr(39.0, options);
  const RenderStatistics s = rendered("adaptive", wires(0.15), wide_rig(), options).statistics;
  EXPECT_EQ(s.interpolated_subpixels, 0U);
  EXPECT_EQ(s.rmse_bound, 0.0);
  EXPECT_EQ(s.beyond_bound, 0.0);
}

/// The proof would sample every other subpixel and cost more time than is saved.
TEST(MethodAdaptive, LeavesAPromiseThatNeedsTooManySamplesToFull) {
  RenderOptions options;
  promise_psnr(60.0, options);
  const Rendered adaptive = rendered("adaptive", wires(2.5), wide_rig(), options);
  EXPECT_EQ(adaptive.statistics.audited_subpixels, 0U);
  EXPECT_EQ(adaptive.frame, rendered("full", wires(2.5), wide_rig()).frame);
}

TEST(MethodAdaptive, KeepsTheRootMeanSquareNearTheToleratedError) {
  for (const double gap : {0.15, 0.6, 2.5})
    for (const double error : {1.0, 2.0, 4.0}) {
      const SceneDescription scene = wires(gap);
      const Rendered full = rendered("full", scene, wide_rig());
      const Rendered adaptive =
          rendered("adaptive", scene, wide_rig(), {.tolerated_error = error, .cancelled = {}});
      // The limit of twice the error is estimated, not proven: half as much more by chance.
      EXPECT_GE(compare(full.frame, adaptive.frame).psnr, 20.0 * std::log10(255.0 / (3.0 * error)))
          << gap << ", " << error;
    }
}

/// Returns a floor, spheres that mirror it, and wires above the picture, of which only shadows and
/// mirror images are seen.
SceneDescription wires_overhead(uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto in = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  SceneDescription scene = wires(20.0);
  for (int n = 0; n < 5; ++n)
    scene.spheres.push_back({.centre = {in(-4, 4), in(-2, 2), in(-2, 1)},
                             .radius = in(0.2, 1.0),
                             .material = static_cast<int>(in(0, 2.99))});
  for (int n = 0; n < 15; ++n)
    scene.cones.push_back({.base = {in(-6, 6), in(4, 6), in(-3, 3)},
                           .base_radius = 0.01,
                           .apex = {in(-6, 6), in(4, 6), in(-3, 3)},
                           .apex_radius = 0.01,
                           .material = 2});
  return scene;
}

/// The root mean square of the sampled subpixels was stated as that of the frame.
TEST(MethodAdaptive, StatesABoundThatHoldsWhereNoSampleShowsTheError) {
  int sampled_less = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const SceneDescription scene = wires_overhead(seed);
    const Rendered full = rendered("full", scene, wide_rig());
    for (const double error : {0.5, 2.0}) {
      const Rendered adaptive =
          rendered("adaptive", scene, wide_rig(), {.tolerated_error = error, .cancelled = {}});
      const double rmse = 255.0 / std::pow(10.0, compare(full.frame, adaptive.frame).psnr / 20.0);
      EXPECT_LE(rmse, adaptive.statistics.rmse_bound + 1e-6) << seed << ", " << error;
      sampled_less += rmse > 2.0 * adaptive.statistics.audited_rmse ? 1 : 0;
    }
  }
  EXPECT_GT(sampled_less, 0) << "the scenes are too easy to test the bound";
}

TEST(MethodAdaptive, RefusesUnsupportedOptions) {
  const optics::OpticalModel model(make_rig({}));
  for (const double error :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    EXPECT_THROW((void)make_method("adaptive", model, {.tolerated_error = error, .cancelled = {}}),
                 Error);
  EXPECT_THROW((void)make_method("adaptive", model, {.samples = 4, .cancelled = {}}), Error);
  RenderOptions promise;
  for (const double db : {0.0, 19.0, 71.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(promise_psnr(db, promise), Error);
  promise_psnr(40.0, promise);
  promise.soft.shadow_samples = 16;
  EXPECT_THROW((void)make_method("adaptive", model, promise), Error);
}

TEST(MethodAdaptive, ChangesItsErrorFromFrameToFrame) {
  const optics::Rig rig = wide_rig();
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  const RenderOptions reusing{.copy_unchanged = true, .cancelled = {}};
  const auto method = make_method("adaptive", model, reusing);
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px});
  std::vector<frames::WovenFrame> kinds;
  for (const double error : {8.0, 1.0, 1.0, 8.0}) {
    const SceneDescription description = test::tiny_scenes().front().scene;
    const Scene scene(description, stage, {}, 1);
    ASSERT_TRUE(method->set_tolerated_error(error));
    ASSERT_TRUE(method->render(scene, stage, frame).completed);
    const Rendered made = rendered("adaptive", description, rig, {.tolerated_error = error});
    EXPECT_EQ(frame, made.frame) << error;
    kinds.push_back(frame);
  }
  EXPECT_NE(kinds[0], kinds[1]);
}

}  // namespace
}  // namespace lenticule::render
