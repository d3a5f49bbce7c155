// SPDX-License-Identifier: Apache-2.0
#include "base/interval.h"

#include <gtest/gtest.h>

namespace lenticule {
namespace {

TEST(Interval, IsEmptyUntilItIsExtended) {
  Interval interval;
  EXPECT_TRUE(interval.empty());
  interval.extend(2.0);
  EXPECT_FALSE(interval.empty());
  EXPECT_EQ(interval.width(), 0.0);
}

TEST(Interval, CoversBothAfterItIsExtendedByAnother) {
  Interval interval{1.0, 2.0};
  interval.extend(Interval{-3.0, 1.5});
  EXPECT_EQ(interval.low, -3.0);
  EXPECT_EQ(interval.high, 2.0);
}

TEST(Interval, IsNotExtendedByAnEmptyOne) {
  Interval interval{1.0, 2.0};
  interval.extend(Interval{});
  EXPECT_EQ(interval.low, 1.0);
  EXPECT_EQ(interval.high, 2.0);
  Interval empty;
  empty.extend(Interval{});
  EXPECT_TRUE(empty.empty());
}

}  // namespace
}  // namespace lenticule
