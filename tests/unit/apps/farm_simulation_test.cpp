// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "apps/lenticule-bench/farm/simulation.h"

namespace lenticule::player {
namespace {

/// Returns a farm in which nothing but rendering takes time.
SimulatedFarm ideal(uint64_t nodes) {
  SimulatedFarm farm;
  farm.nodes = nodes;
  farm.frames = 3200;
  farm.frame_seconds = 10.0;
  farm.frame_spread = 0.0;
  farm.start_seconds = farm.scene_bytes = farm.frame_bytes = 0.0;
  farm.failures_per_hour = 0.0;
  farm.starts_per_second = 1e9;
  farm.metadata_per_second = 1e12;
  return farm;
}

TEST(FarmSimulation, NodesThatOnlyRenderShareTheWork) {
  const SimulatedRun one = simulate_farm(ideal(1));
  EXPECT_NEAR(one.render_seconds, 32000.0, 0.01);
  EXPECT_NEAR(one.efficiency, 1.0, 1e-6);
  EXPECT_NEAR(simulate_farm(ideal(100)).render_seconds, 320.0, 0.01);
  // More nodes than chunks do not help.
  EXPECT_NEAR(simulate_farm(ideal(1000)).render_seconds, 320.0, 0.01);
}

TEST(FarmSimulation, AFileSystemAndASchedulerAreSharedByAllNodes) {
  SimulatedFarm farm = ideal(100);
  farm.scene_bytes = 1e9;  // 100 chunks read 100 GB at 10 GB/s
  farm.node_bytes_per_second = 1e12;
  EXPECT_NEAR(simulate_farm(farm).render_seconds, 320.0 + 10.0, 0.2);
  farm = ideal(100);
  farm.starts_per_second = 0.5;
  EXPECT_NEAR(simulate_farm(farm).render_seconds, 320.0 + 200.0, 0.1);
}

TEST(FarmSimulation, ChunksOfFailedNodesAreRenderedAgain) {
  SimulatedFarm farm = ideal(10);
  farm.failures_per_hour = 1.0;
  const SimulatedRun run = simulate_farm(farm);
  EXPECT_GT(run.failures, 0U);
  EXPECT_GT(run.lost, 0.0);
  EXPECT_LT(run.efficiency, 1.0);
  EXPECT_GT(run.render_seconds, simulate_farm(ideal(10)).render_seconds);
}

TEST(FarmSimulation, ChunksInsideAnIntervalRenderItsKeyFrameUnlessItIsPublished) {
  SimulatedFarm farm = ideal(1);
  farm.chunk_frames = 8;  // the first of four chunks publishes
  EXPECT_EQ(simulate_farm(farm).repeated, 0.0);
  farm.nodes = 400;  // all at the same time
  EXPECT_NEAR(simulate_farm(farm).repeated, 3.0 / 32.0, 1e-6);
  farm.chunk_frames = 32;
  EXPECT_EQ(simulate_farm(farm).repeated, 0.0);
}

}  // namespace
}  // namespace lenticule::player
