// SPDX-License-Identifier: Apache-2.0
// Tests the parts of `lenticule bench exact` that need no clock.
#include "apps/lenticule-bench/render/bench_exact.h"

#include <gtest/gtest.h>

#include <set>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"

namespace lenticule::bench {
namespace {

TEST(ExactVariants, BeginWithTheUnchangedFrameAndHaveNames) {
  std::set<std::string> names;
  for (const ExactVariant& variant : exact_variants())
    EXPECT_TRUE(names.insert(variant.name).second) << variant.name;
  ASSERT_FALSE(exact_variants().empty());
  EXPECT_STREQ(exact_variants().front().name, "whole frame");
  render::RenderOptions options;
  options.samples = 7;
  options.max_depth = 3;
  exact_variants().front().change(options);
  EXPECT_EQ(options.samples, 7);
  EXPECT_EQ(options.max_depth, 3);
}

TEST(UprightRig, HasTheSamePanelAndConeAndAWholePitch) {
  const optics::Rig slanted = lab::kiosk_rig();
  const optics::Rig upright = upright_rig(slanted);
  EXPECT_EQ(upright.panel, slanted.panel);
  EXPECT_EQ(upright.sheet.slant, 0.0);
  EXPECT_EQ(upright.sheet.pitch.value, 8.0);
  EXPECT_NEAR(upright.sheet.pitch.value / upright.sheet.gap.value,
              slanted.sheet.pitch.value / slanted.sheet.gap.value, 1e-12);
}

optics::Rig small_rig() {
  optics::Rig rig = lab::kiosk_rig();
  rig.panel.width_px = 48;
  rig.panel.height_px = 32;
  return rig;
}

TEST(BenchScene, DropsLightsBeyondTheFirst) {
  const BenchScene all({.scene = "builtin:tree:2", .rig = small_rig(), .threads = 1});
  EXPECT_EQ(all.description().lights.size(), 7U);
  EXPECT_EQ(all.dropped_lights(), 0);
  const BenchScene two({.scene = "builtin:tree:2", .rig = small_rig(), .lights = 2, .threads = 1});
  ASSERT_EQ(two.description().lights.size(), 2U);
  EXPECT_EQ(two.dropped_lights(), 5);
  EXPECT_EQ(two.description().lights[1].position, all.description().lights[1].position);
}

TEST(BenchScene, NamesOfBuiltInScenesNeedNoPrefix) {
  EXPECT_EQ(bench_scene_name("tree"), "builtin:tree");
  EXPECT_EQ(bench_scene_name("tree:5"), "builtin:tree:5");
  EXPECT_EQ(bench_scene_name("builtin:tree"), "builtin:tree");
  EXPECT_EQ(bench_scene_name("trees/tree.nff"), "trees/tree.nff");
}

TEST(TimeByTurns, RunsEveryCaseInEveryRun) {
  BenchScene scene({.scene = "builtin:tree:2", .rig = small_rig(), .threads = 1});
  TimedCase with{.scene = &scene, .options = scene.options(1)};
  TimedCase without = with;
  without.with_visibility = false;
  const std::vector<CaseTimes> times = time_by_turns({with, without}, 3);
  ASSERT_EQ(times.size(), 2U);
  EXPECT_EQ(times[0].visibility.size(), 3U);
  EXPECT_EQ(times[0].bare.size(), 3U);
  EXPECT_EQ(times[0].frame.size(), 3U);
  EXPECT_TRUE(times[1].visibility.empty());
  EXPECT_EQ(times[1].statistics.subpixels, scene.subpixels());
  EXPECT_GT(times[1].frame_peak_mib, 0.0);
}

}  // namespace
}  // namespace lenticule::bench
