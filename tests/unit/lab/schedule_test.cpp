// SPDX-License-Identifier: Apache-2.0
#include "lab/schedule.h"

#include <gtest/gtest.h>

namespace lenticule::lab {
namespace {

using Loops = std::vector<std::vector<double>>;

TEST(Schedule, GivesEachItemToTheCoreThatIsFreeFirst) {
  const std::vector<double> items = {3.0, 1.0, 1.0, 4.0};
  EXPECT_EQ(scheduled_time(items, 1), 9.0);
  EXPECT_EQ(scheduled_time(items, 2), 6.0) << "the last item waits for the second core";
  EXPECT_EQ(scheduled_time(items, 3), 5.0);
  EXPECT_EQ(scheduled_time(items, 64), 4.0) << "the longest item";
}

TEST(Schedule, WaitsForALoopBeforeTheNext) {
  const Loops loops = {{2.0, 1.0}, {}, {1.0, 3.0, 1.0}};
  EXPECT_EQ(scheduled_time(loops, 1), 8.0);
  EXPECT_EQ(scheduled_time(loops, 2), 2.0 + 3.0);
  EXPECT_EQ(scheduled_time(Loops{}, 4), 0.0);
}

}  // namespace
}  // namespace lenticule::lab
