// SPDX-License-Identifier: Apache-2.0
// Compares small woven pictures of every built-in scene, textures included, with the reference
// implementation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "render/methods/method.h"
#include "tests/support/oracles/reference_renderer.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::test {
namespace {

constexpr int kMaxDepth = 2;

struct Case {
  const char* scene;
  int size;
};

frames::WovenFrame render_full(const render::SceneDescription& description,
                               const render::Stage& stage, const optics::OpticalModel& model) {
  const render::Scene scene(description, stage, {});
  const auto method =
      render::make_method("full", model, {.threads = 1, .max_depth = kMaxDepth, .cancelled = {}});
  frames::WovenFrame frame({model.rig().panel.width_px, model.rig().panel.height_px});
  EXPECT_TRUE(method->render(scene, stage, frame).completed);
  return frame;
}

/// Returns true if a ray beside this one gives the rendered colour. Covers outlines, and outlines
/// in curved mirrors, which magnify the rounding of single precision.
bool lies_on_an_outline(const render::SceneDescription& scene, const render::Stage& stage,
                        const optics::OpticalModel& model, int i, int j, int channel,
                        double rendered) {
  double low = 255.0;
  double high = 0.0;
  for (const double reach : {1e-5, 1e-4, 1e-3})
    for (const double x : {-reach, 0.0, reach})
      for (const double y : {-reach, 0.0, reach}) {
        const double value = reference_subpixel(
            scene, stage, model, i, j, channel,
            {.max_depth = kMaxDepth, .move_x_mm = x, .move_y_mm = y, .from_near_plane = true});
        low = std::min(low, value);
        high = std::max(high, value);
      }
  return rendered >= low - 1.0 && rendered <= high + 1.0;
}

class BuiltInScenes : public ::testing::TestWithParam<Case> {};

TEST_P(BuiltInScenes, AgreeWithTheReference) {
  const auto [name, size] = GetParam();
  const render::SceneDescription scene =
      tools::describe_built_in(scenes::find_scene(name), size, 40);
  // The paper's upright lenses with parallel zones, and slanted ones for a viewer at a distance.
  const TinyRig upright{
      .pitch_subpx = 12.0, .slant = 0.0, .distance_mm = std::numeric_limits<double>::infinity()};
  int on_outlines = 0;
  double darkest = 255.0;
  double brightest = 0.0;
  for (const TinyRig& tiny : {upright, TinyRig{}}) {
    const optics::OpticalModel model(make_rig(tiny));
    const render::Stage stage = render::make_stage(scene, model);
    EXPECT_GT(stage.near_mm, 0.0) << "something is in front of the panel";
    EXPECT_LT(stage.far_mm, 0.0) << "something stands behind it";
    const frames::WovenFrame frame = render_full(scene, stage, model);
    for (int j = 0; j < frame.height(); ++j)
      for (int i = 0; i < frame.width(); ++i)
        for (int channel = 0; channel < 3; ++channel) {
          const double rendered = frame.row(j)[3 * i + channel];
          const double expected =
              reference_subpixel(scene, stage, model, i, j, channel,
                                 {.max_depth = kMaxDepth, .from_near_plane = true});
          darkest = std::min(darkest, expected);
          brightest = std::max(brightest, expected);
          if (std::abs(expected - rendered) <= 1.0) continue;
          ++on_outlines;
          EXPECT_TRUE(lies_on_an_outline(scene, stage, model, i, j, channel, rendered))
              << name << " subpixel " << i << ", " << j << ", " << channel << ": oracle "
              << expected << ", full " << rendered;
        }
  }
  EXPECT_LE(on_outlines, 6) << "of 576 subpixels";
  EXPECT_GT(brightest - darkest, 60.0) << "there is something to see";
}

INSTANTIATE_TEST_SUITE_P(Scenes, BuiltInScenes,
                         ::testing::Values(Case{"demo", 2}, Case{"teapot", 2}, Case{"room", 2},
                                           Case{"small-balls", 1}, Case{"primitives", 2},
                                           Case{"tree", 4}, Case{"gears", 1}, Case{"balls", 2}),
                         [](const auto& instance) {
                           std::string name = instance.param.scene;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

// Checks that every scene of the list has a case, so that new scenes are tested.
TEST(BuiltInScenes, AreAllTested) { EXPECT_EQ(scenes::scene_list().size(), 8U); }

}  // namespace
}  // namespace lenticule::test
