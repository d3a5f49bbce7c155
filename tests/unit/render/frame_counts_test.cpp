// SPDX-License-Identifier: Apache-2.0
// Tests the table of a frame's counters.
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "render/options/render_options.h"

namespace lenticule::render {
namespace {

TEST(FrameCounts, EveryFieldHasOneNameInTheTable) {
  FrameCounts counts;
  std::set<std::string> names;
  for (const FrameCounter& counter : kFrameCounters) {
    EXPECT_EQ(counts.*counter.field, 0U) << counter.name << ": listed twice";
    counts.*counter.field = 1;
    EXPECT_TRUE(names.insert(counter.name).second) << counter.name;
  }
}

TEST(FrameCounts, AddUpExceptForFiguresOfTheScene) {
  FrameCounts one, other;
  for (const FrameCounter& counter : kFrameCounters) {
    one.*counter.field = 3;
    other.*counter.field = 5;
  }
  one += other;
  for (const FrameCounter& counter : kFrameCounters)
    EXPECT_EQ(one.*counter.field, std::string("lights_left_out") == counter.name ? 5U : 8U)
        << counter.name;
}

}  // namespace
}  // namespace lenticule::render
