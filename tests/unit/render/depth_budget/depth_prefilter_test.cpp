// SPDX-License-Identifier: Apache-2.0
// Tests methods with a prefilter: the parts that stay unchanged, and the filtered rest.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/depth_budget/prefilter.h"
#include "render/methods/method.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/oracles/beam_oracle.h"
#include "tests/support/oracles/visibility_oracle.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;
constexpr int kThreads = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Rendered {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

Rendered rendered(const SceneDescription& description, const Stage& stage,
                  const optics::OpticalModel& model, const RenderOptions& options) {
  // The scene uses as many threads as the work may have, since Embree's limit is global.
  const Scene scene(description, stage, {}, kThreads);
  const optics::Panel& panel = model.rig().panel;
  Rendered out{frames::WovenFrame({panel.width_px, panel.height_px}), {}};
  out.statistics = make_method("full", model, options)->render(scene, stage, out.frame);
  EXPECT_TRUE(out.statistics.completed);
  return out;
}

RenderOptions with(Prefilter prefilter, int samples = 17) {
  return {.prefilter = prefilter, .prefilter_samples = samples, .cancelled = {}};
}

/// Returns a stage for scenes as deep as several depths of field.
Stage deep_stage() { return make_tiny_stage({.depth_scale = 8.0, .turn_degrees = 20.0}); }

/// Returns the depth of each subpixel in depths of field; minus infinity for background.
std::vector<double> depths(const SceneDescription& description, const Stage& stage,
                           const optics::OpticalModel& model) {
  const Scene scene(description, stage, {}, 1);
  const DepthOfField field(model);
  const optics::Rig& rig = model.rig();
  const double start_mm = std::min(0.99 * rig.viewing.distance.value, 1e5);
  std::vector<double> found;
  for (int j = 0; j < rig.panel.height_px; ++j)
    for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
      const test::OracleRay ray = test::oracle_ray(model, s / 3, j, s % 3);
      double z_mm = -kInfinity;
      for (const test::OracleHit& hit : test::oracle_hits(scene, ray, start_mm))
        if (hit.met) z_mm = std::max(z_mm, hit.z_mm);
      found.push_back(z_mm / field.along_mm(ray.tan_x, ray.tan_y));
    }
  return found;
}

TEST(DepthPrefilter, DoesNotChangeScenesWithinTheDepthOfField) {
  const optics::OpticalModel model(make_rig({.width = 60, .height = 40}));
  for (test::NamedScene named : test::tiny_scenes()) {
    const Stage stage = make_tiny_stage({.depth_scale = 0.5});
    named.scene.background = {};
    const Rendered off = rendered(named.scene, stage, model, with(Prefilter::Off));
    const Rendered depth = rendered(named.scene, stage, model, with(Prefilter::Depth));
    EXPECT_EQ(off.frame, rendered(named.scene, stage, model, {}).frame);
    const std::vector<double> depth_of = depths(named.scene, stage, model);
    for (size_t n = 0; n < depth_of.size(); ++n)
      if (std::isfinite(depth_of[n])) {
        ASSERT_LT(std::abs(depth_of[n]), 1.0);
        EXPECT_EQ(off.frame.bytes()[n], depth.frame.bytes()[n]) << named.name << n;
      }
    EXPECT_EQ(off.statistics.prefilter_rays, 0U);
  }
}

/// Edges of objects in the panel's plane stay sharp, also in front of deep content.
TEST(DepthPrefilter, KeepsSharpEdges) {
  const optics::OpticalModel model(make_rig({.width = 60, .height = 40}));
  int sharp = 0, changed = 0;
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const Rendered off = rendered(named.scene, deep_stage(), model, with(Prefilter::Off));
    const Rendered depth = rendered(named.scene, deep_stage(), model, with(Prefilter::Depth));
    const std::vector<double> depth_of = depths(named.scene, deep_stage(), model);
    for (size_t n = 0; n < depth_of.size(); ++n)
      if (std::abs(depth_of[n]) < 0.9999) {
        ++sharp;
        EXPECT_EQ(off.frame.bytes()[n], depth.frame.bytes()[n]) << named.name << n;
      } else {
        changed += off.frame.bytes()[n] != depth.frame.bytes()[n] ? 1 : 0;
      }
  }
  EXPECT_GT(sharp, 1000);
  EXPECT_GT(changed, 500);
}

/// Returns true if the codes of the same colour are equal within a lens's width to both sides and
/// one row above and below, in the same band of sixteen rows.
bool all_alike_around(const frames::WovenFrame& full, int reach, int j, int s) {
  for (int r = std::max(j - 1, 0); r <= std::min(j + 1, full.height() - 1); ++r) {
    if (r / 16 != j / 16) continue;
    const int far = r == j ? reach : 1;
    for (int at = s - 3 * far; at <= s + 3 * far; at += 3)
      if (at >= 0 && at < 3 * full.width() && std::abs(full.row(r)[at] - full.row(j)[s]) > 2)
        return false;
  }
  return true;
}

/// Checks the claims about neighbouring codes and about the beam with the reference.
void expect_means_over_the_beam(Prefilter prefilter) {
  constexpr int kWidth = 12, kHeight = 8, kRow = 3 * kWidth;
  const optics::OpticalModel model(make_rig({}));
  uint64_t averaged = 0, left_out = 0, off = 0;
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const Rendered full = rendered(named.scene, deep_stage(), model, with(Prefilter::Off));
    const Rendered depth = rendered(named.scene, deep_stage(), model, with(prefilter));
    const std::vector<double> depth_of = depths(named.scene, deep_stage(), model);
    const auto code = [&](int j, int s) { return int{full.frame.row(j)[s]}; };
    uint64_t of_scene = 0;
    for (int j = 0; j < kHeight; ++j)
      for (int s = 0; s < kRow; ++s) {
        const auto n = static_cast<size_t>(j * kRow + s);
        const int rays = beam_rays(std::abs(depth_of[n]), 17);
        if (prefilter == Prefilter::Depth && std::abs(depth_of[n]) <= 1.0) continue;
        if (all_alike_around(full.frame, 3, j, s)) {
          ++left_out;
          EXPECT_EQ(int{depth.frame.row(j)[s]}, code(j, s));
          continue;
        }
        ++of_scene;
        const double mean = test::beam_mean(named.scene, deep_stage(), model, s / 3, j, s % 3,
                                            beam_samples(rays), 0.99 * 700.0);
        if (std::abs(mean - int{depth.frame.row(j)[s]}) > 1.0) ++off;
      }
    averaged += of_scene;
    EXPECT_NEAR(static_cast<double>(depth.statistics.prefiltered_subpixels),
                static_cast<double>(of_scene), 2.0)
        << named.name;
  }
  EXPECT_GT(averaged, 300U);
  EXPECT_GT(left_out, 15U);
  // Rays that pass an edge within a hundredth of a subpixel may see the other side.
  EXPECT_LE(off, averaged / 50);
}

TEST(DepthPrefilter, IsTheMeanOverTheBeam) {
  expect_means_over_the_beam(Prefilter::Depth);
  expect_means_over_the_beam(Prefilter::Beam);
}

TEST(DepthPrefilter, GivesTheSameBytesForAnyThreadsTilesAndInstructionSet) {
  const optics::OpticalModel model(make_rig({.width = 150, .height = 40}));
  for (const test::NamedScene& named : test::tiny_scenes())
    for (const Prefilter prefilter : {Prefilter::Depth, Prefilter::Beam, Prefilter::Exhaustive}) {
      RenderOptions options = with(prefilter, 9);
      options.threads = 1;
      const Rendered one = rendered(named.scene, deep_stage(), model, options);
      options.threads = kThreads;
      options.tiles_backwards = true;
      EXPECT_EQ(one.frame, rendered(named.scene, deep_stage(), model, options).frame);
      options.use_shaft_culling = false;
      options.skip_background = false;
      EXPECT_EQ(one.frame, rendered(named.scene, deep_stage(), model, options).frame);
      for (const Isa isa : test::every_instruction_set()) {
        options.isa = isa;
        EXPECT_EQ(one.frame, rendered(named.scene, deep_stage(), model, options).frame);
      }
    }
}

/// The subpixels with traced neighbours are counted, and compared by their bytes.
TEST(DepthPrefilter, TracesNoExtraRaysInUniformRegions) {
  const optics::OpticalModel model(make_rig({.width = 60, .height = 40}));
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const Rendered full = rendered(named.scene, deep_stage(), model, with(Prefilter::Off));
    const Rendered beam = rendered(named.scene, deep_stage(), model, with(Prefilter::Beam));
    uint64_t averaged = 0;
    for (int j = 0; j < 40; ++j)
      for (int s = 0; s < 180; ++s)
        if (all_alike_around(full.frame, 3, j, s))
          EXPECT_EQ(full.frame.row(j)[s], beam.frame.row(j)[s]) << named.name;
        else
          ++averaged;
    EXPECT_EQ(beam.statistics.prefiltered_subpixels, averaged) << named.name;
  }
}

TEST(DepthPrefilter, CountsItsRays) {
  const optics::OpticalModel model(make_rig({.width = 60, .height = 40}));
  const SceneDescription scene = test::tiny_scenes()[0].scene;
  const Rendered off = rendered(scene, deep_stage(), model, with(Prefilter::Off));
  const Rendered depth = rendered(scene, deep_stage(), model, with(Prefilter::Depth));
  const RenderStatistics& s = depth.statistics;
  EXPECT_GT(s.prefiltered_subpixels, 0U);
  EXPECT_GE(s.prefilter_rays, 4 * s.prefiltered_subpixels);
  EXPECT_LE(s.prefilter_rays, 16 * s.prefiltered_subpixels);
  EXPECT_GT(s.prefilter_rays_left_out, 0U);
  EXPECT_EQ(s.primary_rays, off.statistics.primary_rays + s.prefilter_rays);
}

/// A wall with horizontal waves, parallel to the panel.
struct Grating {
  double z_mm = 0.0;
  double per_mm = 0.1;  ///< spatial frequency in waves
};
constexpr double kMean = 0.45, kSwing = 0.4;

SceneDescription wall_of(const Grating& grating) {
  constexpr int kTexels = 256;
  constexpr double kHalf = 20000.0;
  auto texture = std::make_shared<Texture>();
  texture->width = kTexels;
  texture->height = 1;
  for (int n = 0; n < kTexels; ++n) {
    const double at = (n + 0.5) / kTexels;
    const auto value = static_cast<float>(kMean + kSwing * std::cos(2.0 * std::numbers::pi * at));
    for (const float v : {value, value, value, 1.0F}) texture->rgba.push_back(v);
  }
  SceneDescription scene;
  scene.ambient = Vec3{1, 1, 1};
  scene.materials = {Material{.name = "wall", .texture = 0}};
  scene.textures = {texture};
  const auto end = static_cast<float>(kHalf * grating.per_mm);
  TriangleMesh wall =
      test::rectangle_mesh({-kHalf, -kHalf, grating.z_mm}, {2 * kHalf, 0, 0}, {0, 2 * kHalf, 0}, 0);
  wall.uvs = {{-end, 0}, {end, 0}, {end, 0}, {-end, 0}};
  scene.meshes = {wall};
  Light black;
  black.colour = {};
  scene.lights = {black};
  return scene;
}

struct Contrast {
  double seen = 0.0;  ///< contrast of the wave where subpixels of this beam see it
  double expected =
      0.0;  ///< contrast expected from the lens, the subpixel and, under slanted lenses, its height
};

double sinc(double waves) {
  return waves == 0.0 ? 1.0 : std::sin(std::numbers::pi * waves) / (std::numbers::pi * waves);
}

/// Fits the wave to the frame's codes; the expected contrast varies with the ray and has the same
/// weights.
Contrast contrast_of(const frames::WovenFrame& frame, const optics::OpticalModel& model,
                     const Grating& grating) {
  const DepthOfField field(model);
  double seen = 0.0, expected = 0.0, all = 0.0;
  for (int j = 0; j < frame.height(); ++j)
    for (int s = 0; s < 3 * frame.width(); ++s) {
      const optics::SubpixelRay ray = model.ray(s / 3, j, s % 3);
      const double x = ray.lens_x_mm + grating.z_mm * ray.tan_x;
      const double wave = std::cos(2.0 * std::numbers::pi * grating.per_mm * x);
      const double light = frames::linear_from_srgb(frame.row(j)[s] / 255.0);
      const double across = model.pitch_mm() * grating.per_mm;
      const double subpixel =
          std::abs(grating.z_mm) / field.along_mm(ray.tan_x, ray.tan_y) * across;
      // A pixel's height moves the lens point along a slanted lens, and the place under the lens
      // with it.
      const double height_mm = model.rig().sheet.slant * model.rig().panel.pixel_height.value;
      const double subpixel_mm = model.rig().panel.pixel_width.value / 3.0;
      const double aside = 1.0 + grating.z_mm / field.along_mm(ray.tan_x, ray.tan_y) *
                                     model.pitch_mm() / subpixel_mm;
      const double down = height_mm * aside * grating.per_mm;
      seen += (light - kMean) / kSwing * wave;
      expected += sinc(across) * sinc(subpixel) * sinc(down) * wave * wave;
      all += wave * wave;
    }
  return {seen / all, expected / all};
}

optics::Rig parallel_rig() {
  return make_rig(
      {.width = 120, .height = 4, .slant = 0.25, .distance_mm = kInfinity, .pixel_mm = 1.0});
}

TEST(DepthPrefilter, HasTheContrastOfItsBeam) {
  const optics::OpticalModel model(parallel_rig());
  for (const double depth : {0.0, 0.5, 1.5, 2.0, 4.0, 8.0, -1.5, -4.0, -8.0})
    for (const double waves : {0.3, 0.6, 0.9}) {
      // That many waves in the width of the beam.
      const Grating grating{.z_mm = depth * model.depth_of_field_mm(),
                            .per_mm = waves / (model.pitch_mm() * (1.0 + std::abs(depth)))};
      const SceneDescription wall = wall_of(grating);
      const Stage stage = make_tiny_stage({.mm_per_unit = 1.0});
      const auto contrast = [&](Prefilter prefilter, int samples) {
        return contrast_of(rendered(wall, stage, model, with(prefilter, samples)).frame, model,
                           grating);
      };
      const Contrast beam = contrast(Prefilter::Exhaustive, 129);
      EXPECT_NEAR(beam.seen, beam.expected, 0.025) << depth << " " << waves;
      const Contrast filtered = contrast(Prefilter::Depth, 17);
      const bool beyond = std::abs(depth) > 1.0;
      EXPECT_NEAR(filtered.seen, beyond ? filtered.expected : 1.0, beyond ? 0.09 : 0.01)
          << depth << " " << waves;
      EXPECT_NEAR(contrast(Prefilter::Off, 17).seen, 1.0, 0.01) << depth << " " << waves;
    }
}

/// Detail much finer than the beam disappears, where a single ray shows it as noise with full
/// contrast.
TEST(DepthPrefilter, RemovesDetailFinerThanTheBeam) {
  const optics::OpticalModel model(parallel_rig());
  const Grating grating{.z_mm = -4.0 * model.depth_of_field_mm(),
                        .per_mm = 2.6 / (5.0 * model.pitch_mm())};
  const SceneDescription wall = wall_of(grating);
  const Stage stage = make_tiny_stage({.mm_per_unit = 1.0});
  const auto deviation = [&](Prefilter prefilter) {
    const Rendered frame = rendered(wall, stage, model, with(prefilter));
    double squares = 0.0;
    for (const uint8_t code : frame.frame.bytes())
      squares += std::pow(frames::linear_from_srgb(code / 255.0) - kMean, 2);
    return std::sqrt(squares / static_cast<double>(frame.frame.bytes().size()));
  };
  EXPECT_GT(deviation(Prefilter::Off), 0.25);
  EXPECT_LT(deviation(Prefilter::Depth), 0.08);
}

TEST(DepthPrefilter, RefusesUnsupportedOptions) {
  const optics::OpticalModel model(make_rig({}));
  const auto refused = [&](const std::string& method, const RenderOptions& options,
                           const std::string& what, const std::string& hint) {
    try {
      (void)make_method(method, model, options);
      ADD_FAILURE() << what;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Usage);
      EXPECT_EQ(std::string(error.what()), what);
      EXPECT_EQ(error.hint(), hint);
    }
  };
  for (const char* method : {"adaptive", "lens-view", "temporal"})
    refused(method, with(Prefilter::Depth), std::string("method ") + method + ": has no prefilter",
            "use method full");
  RenderOptions several = with(Prefilter::Beam);
  several.samples = 4;
  refused("full", several, "samples 4: cannot be combined with a prefilter",
          "leave out --samples; --prefilter-samples sets the largest number");
  refused("full", with(Prefilter::Depth, 2), "prefilter samples 2: not in 3 ... 1024", "");
  refused("full", with(Prefilter::Depth, 1025), "prefilter samples 1025: not in 3 ... 1024", "");
}

}  // namespace
}  // namespace lenticule::render
