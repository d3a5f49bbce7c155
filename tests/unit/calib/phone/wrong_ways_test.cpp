// SPDX-License-Identifier: Apache-2.0
// Mistakes with photographs, from the simulator of lenticule-bench, which shares no code with the
// fit.
#include "apps/lenticule-bench/calibrate/wrong_ways.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/scratch_folder.h"
#include "tests/support/small_workshop.h"

namespace lenticule::phone_bench {
namespace {

TEST(WrongWays, AMistakeInOnePhotographIsRefusedWithItsCause) {
  const test::ScratchFolder folder;
  WrongWayTrial trial(2001, test::small_workshop(3), folder.path());
  for (const char* name :
       {"hand that turns by 8 degrees a second", "out of focus", "overexposed", "too far away"}) {
    const auto way = std::ranges::find(wrong_ways(), name, &WrongWay::name);
    ASSERT_NE(way, wrong_ways().end()) << name;
    const WrongWayResult result = trial.calibrate(*way);
    EXPECT_EQ(result.outcome, HandOutcome::Refused) << name << ": " << result.error_lenses;
    EXPECT_TRUE(result.cause_named) << name << ": " << result.reason;
  }
}

}  // namespace
}  // namespace lenticule::phone_bench
