// SPDX-License-Identifier: Apache-2.0
#include "base/statistics.h"

#include <gtest/gtest.h>

namespace lenticule {
namespace {

using Values = std::vector<double>;

TEST(Median, IsTheMiddleValueOrTheMeanOfTwo) {
  EXPECT_EQ(median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(median({4.0, 1.0, 2.0, 3.0}), 2.5);
  EXPECT_EQ(median({}), 0.0);
}

TEST(UpperMedian, IsTheUpperOfTwoMiddleValues) {
  EXPECT_EQ(upper_median(Values{3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(upper_median(Values{4.0, 1.0, 2.0, 3.0}), 3.0);
  EXPECT_EQ(upper_median(Values{}), 0.0);
}

TEST(MedianMagnitude, IgnoresSigns) {
  EXPECT_EQ(median_magnitude({-3.0, 1.0, -2.0}), 2.0);
  EXPECT_EQ(median_magnitude({}), 0.0);
}

TEST(Quantile, IsOneOfTheValues) {
  const Values values = {50.0, 10.0, 40.0, 20.0, 30.0};
  EXPECT_EQ(quantile(values, 0.0), 10.0);
  EXPECT_EQ(quantile(values, 0.5), 30.0);
  EXPECT_EQ(quantile(values, 0.74), 30.0) << "rounded down";
  EXPECT_EQ(quantile(values, 0.75), 40.0);
  EXPECT_EQ(quantile(values, 1.0), 50.0);
  EXPECT_EQ(quantile(Values{}, 0.5), 0.0);
}

TEST(ValueInOrder, CountsFromTheSmallest) {
  EXPECT_EQ(value_in_order(std::vector<float>{3.0F, 1.0F, 2.0F}, 0), 1.0F);
  EXPECT_EQ(value_in_order(std::vector<float>{3.0F, 1.0F, 2.0F}, 2), 3.0F);
}

}  // namespace
}  // namespace lenticule
