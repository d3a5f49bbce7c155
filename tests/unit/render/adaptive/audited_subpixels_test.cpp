// SPDX-License-Identifier: Apache-2.0
// Tests that the reference colours in the audit of method adaptive equal those of method full to
// the last byte.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "render/methods/adaptive/audit.h"
#include "render/methods/method.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

struct Rendered {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

Rendered rendered(const std::string& method, const SceneDescription& description,
                  const optics::Rig& rig, const RenderOptions& options) {
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  // Embree limits the threads of the process to those that commit the scene.
  const Scene scene(description, stage, {}, options.threads);
  Rendered out{frames::WovenFrame({rig.panel.width_px, rig.panel.height_px}), {}};
  out.statistics = make_method(method, model, options)->render(scene, stage, out.frame);
  EXPECT_TRUE(out.statistics.completed);
  return out;
}

/// Makes three thin rods with balls at their ends, a small block where they cross, and at each end
/// a smaller, rotated copy of the whole.
class Jacks {
 public:
  explicit Jacks(SceneDescription& scene) : scene_(scene) {}

  void add(Vec3 centre, double size, int levels, int came_along = -1) {
    const std::array<Vec3, 3> axes = {Vec3{0.96, 0.28, 0.0}, Vec3{-0.28, 0.96, 0.0},
                                      Vec3{0.0, 0.0, 1.0}};
    const double block = 0.09 * size;
    const Vec3 half{block, block, block};
    scene_.meshes.push_back(test::box_mesh(centre - half, centre + half, 0));
    for (int n = 0; n < 6; ++n) {
      const Vec3 arm = axes[static_cast<size_t>(n / 2)] * (n % 2 == 0 ? size : -size);
      if (n % 2 == 0) add_rod(centre - arm, centre + arm, 0.04 * size);
      scene_.spheres.push_back({.centre = centre + arm, .radius = 0.1 * size, .material = n % 2});
      // No copy in the direction of the parent.
      if (levels > 1 && n != came_along) add(centre + arm, 0.45 * size, levels - 1, n ^ 1);
    }
  }

 private:
  void add_rod(Vec3 from, Vec3 to, double radius) {
    scene_.cones.push_back(
        {.base = from, .base_radius = radius, .apex = to, .apex_radius = radius, .material = 1});
  }

  SceneDescription& scene_;
};

/// Returns a scene of mirrors, in part of glass if there is any transmittance.
SceneDescription jacks(double transmittance = 0.0) {
  SceneDescription scene;
  scene.background = {0.08, 0.36, 0.53};
  scene.colour_managed = false;
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  scene.lights = {{.position = {9, 12, 10}, .colour = {0.7, 0.7, 0.7}},
                  {.position = {-11, 4, 9}, .colour = {0.5, 0.5, 0.5}}};
  scene.materials = {{.colour = {1.0, 0.75, 0.3}, .diffuse = 0.25, .specular = 0.75, .shine = 20},
                     {.colour = {0.7, 0.9, 1.0},
                      .diffuse = 0.2,
                      .specular = 0.7,
                      .shine = 40,
                      .transmittance = transmittance,
                      .refraction_index = 1.4}};
  Jacks(scene).add({0, 0, 0}, 1.7, 3);
  // A frame of small objects alone would be left to method full.
  scene.meshes.push_back(test::box_mesh({-20, -20, -4}, {20, 20, -3.5}, 1));
  return scene;
}

struct Audited {
  size_t count = 0;
  size_t different = 0;
};

Audited audited(const frames::WovenFrame& full, const frames::WovenFrame& adaptive) {
  Audited sum;
  const auto width = static_cast<uint32_t>(3 * full.width());
  for (int row = 0; row < full.height(); ++row)
    for (uint32_t stretch = 0; stretch * kSampledOneIn < width; ++stretch) {
      const SampledPair sampled = AuditSelection{}.pair(static_cast<uint32_t>(row), stretch);
      for (const uint32_t at : {sampled.retracing, sampled.evaluation}) {
        if (at >= width) continue;
        ++sum.count;
        sum.different += full.row(row)[at] != adaptive.row(row)[at] ? 1 : 0;
      }
    }
  return sum;
}

constexpr double kNeverRetraced =
    40.0;  ///< code values; an error limit so large that no band is retraced

optics::Rig rig_of(double slant = 1.0 / 3.0) {
  return make_rig({.width = 400, .height = 240, .slant = slant, .pixel_mm = 0.1});
}

TEST(AuditedSubpixels, EqualFullForRepeatedlyMirroredThinObjects) {
  for (const double transmittance : {0.0, 0.5})
    for (const int depth : {1, 2, 3, 6}) {
      const SceneDescription scene = jacks(transmittance);
      RenderOptions options{.threads = 2, .max_depth = depth, .cancelled = {}};
      const Rendered full = rendered("full", scene, rig_of(), options);
      options.tolerated_error = kNeverRetraced;
      const Rendered adaptive = rendered("adaptive", scene, rig_of(), options);
      const Audited all = audited(full.frame, adaptive.frame);
      EXPECT_GT(all.count, 1000U);
      EXPECT_EQ(all.different, 0U) << "depth " << depth << ", glass " << transmittance;
      EXPECT_GT(adaptive.statistics.interpolated_subpixels, 0U);
      // Otherwise the scene would have too few secondary rays for the comparison.
      EXPECT_GT(adaptive.statistics.secondary_rays, 10000U);
    }
}

TEST(AuditedSubpixels, EqualFullForEveryInstructionSetAndNumberOfThreads) {
  const SceneDescription scene = jacks();
  RenderOptions options{.threads = 1, .max_depth = 6, .cancelled = {}};
  const Rendered full = rendered("full", scene, rig_of(), options);
  options.tolerated_error = kNeverRetraced;
  for (const Isa isa : test::every_instruction_set())
    for (const int threads : {1, 3}) {
      options.isa = isa;
      options.threads = threads;
      const Audited all = audited(full.frame, rendered("adaptive", scene, rig_of(), options).frame);
      EXPECT_EQ(all.different, 0U) << isa_name(isa) << ", " << threads;
    }
}

/// Rows and columns that end inside a tile, lenses that lean either way, subpixels whose rays come
/// from the rig's map itself, eyes at infinity.
TEST(AuditedSubpixels, EqualFullOnEveryKindOfRig) {
  const SceneDescription scene = jacks();
  std::vector<optics::Rig> rigs = {
      rig_of(-0.2),
      rig_of(0.0),
      make_rig({.width = 390, .height = 231, .pixel_mm = 0.1}),
      make_rig({.width = 400, .height = 64, .pixel_mm = 4.0}),
      make_rig({.width = 400, .height = 64, .distance_mm = HUGE_VAL, .pixel_mm = 0.1}),
      make_rig({.width = 400, .height = 64, .pixel_mm = 0.1})};
  // Rays come from the map, one by one, if there is a residual map.
  std::mt19937_64 random(5);
  rigs.back().sheet.residual = test::random_residual(random, 7, 5, 0.15);
  for (const optics::Rig& rig : rigs) {
    RenderOptions options{.threads = 2, .max_depth = 5, .cancelled = {}};
    const Rendered full = rendered("full", scene, rig, options);
    options.tolerated_error = kNeverRetraced;
    const Audited all = audited(full.frame, rendered("adaptive", scene, rig, options).frame);
    EXPECT_GT(all.count, 200U);
    EXPECT_EQ(all.different, 0U) << rig.panel.width_px << " x " << rig.panel.height_px << ", slant "
                                 << rig.sheet.slant;
  }
}

TEST(AuditedSubpixels, KeepTheErrorBoundForMirroredThinObjects) {
  for (const double error : {1.0, 3.0}) {
    const SceneDescription scene = jacks();
    RenderOptions options{.threads = 2, .max_depth = 6, .cancelled = {}};
    const Rendered full = rendered("full", scene, rig_of(), options);
    options.tolerated_error = error;
    const Rendered adaptive = rendered("adaptive", scene, rig_of(), options);
    size_t beyond = 0;
    for (size_t n = 0; n < full.frame.bytes().size(); ++n)
      beyond += std::abs(int{full.frame.bytes()[n]} - int{adaptive.frame.bytes()[n]}) > error;
    EXPECT_LE(static_cast<double>(beyond) / static_cast<double>(full.frame.bytes().size()),
              adaptive.statistics.beyond_bound);
  }
}

}  // namespace
}  // namespace lenticule::render
