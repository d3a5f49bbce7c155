// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/bench.h"

#include <gtest/gtest.h>

#include <set>

#include "lab/stability/probes.h"
#include "optics/rig_file.h"
#include "render/scene/stage.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::bench {
namespace {

TEST(Benchmarks, HaveDifferentNames) {
  std::set<std::string> names;
  for (const Benchmark& benchmark : benchmarks()) EXPECT_TRUE(names.insert(benchmark.name).second);
  EXPECT_TRUE(names.contains("exact"));
  EXPECT_TRUE(names.contains("memory"));
}

TEST(KioskRig, IsTheSampleRig) {
  const optics::Rig sample =
      optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/kiosk-27-4k.toml");
  EXPECT_EQ(optics::fingerprint(lab::kiosk_rig()), optics::fingerprint(sample));
  EXPECT_NO_THROW(optics::validate_rig(lab::kiosk_rig(), "kiosk"));
}

TEST(TimeVisibility, TracesEverySubpixel) {
  const optics::Rig rig = test::make_rig({.width = 50, .height = 30});
  const render::Scene scene(test::tiny_scenes().front().scene, test::make_tiny_stage(), {});
  const lab::VisibilityTiming timing = lab::time_visibility(scene, optics::OpticalModel(rig), 2);
  EXPECT_EQ(timing.rays, 50U * 30U * 3U);
  EXPECT_GT(timing.bare_seconds, 0.0);
  EXPECT_GT(timing.pass_seconds, 0.0);
}

}  // namespace
}  // namespace lenticule::bench
