// SPDX-License-Identifier: Apache-2.0
#include "frames/rational.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/error_matchers.h"

namespace lenticule::frames {
namespace {

using test::error_of;

TEST(Rate, IsKeptInLowestTerms) {
  EXPECT_EQ(make_rate(120, 2), (Rate{60, 1}));
  EXPECT_EQ(make_rate(48000, 2002), (Rate{24000, 1001}));
}

TEST(Rate, BroadcastNamesAreExactRatios) {
  EXPECT_EQ(parse_rate("23.976"), (Rate{24000, 1001}));
  EXPECT_EQ(parse_rate("29.97"), (Rate{30000, 1001}));
  EXPECT_EQ(parse_rate("59.94"), (Rate{60000, 1001}));
  EXPECT_EQ(parse_rate("119.88"), (Rate{120000, 1001}));
}

TEST(Rate, DecimalsAndFractionsAreExact) {
  EXPECT_EQ(parse_rate("60"), (Rate{60, 1}));
  EXPECT_EQ(parse_rate("12.5"), (Rate{25, 2}));
  EXPECT_EQ(parse_rate("0.1"), (Rate{1, 10}));
  EXPECT_EQ(parse_rate("24000/1001"), (Rate{24000, 1001}));
}

TEST(Rate, TextRoundTrips) {
  for (const char* text : {"60", "24000/1001", "25/2", "1/3600", "10000"})
    EXPECT_EQ(to_string(parse_rate(text)), text);
  EXPECT_DOUBLE_EQ(parse_rate("25/2").hertz(), 12.5);
}

TEST(Rate, InvalidTextIsAUsageError) {
  for (const char* text : {"",
                           "abc",
                           "-1",
                           "0",
                           "0/1",
                           "1/0",
                           "-1/-1",
                           "1/",
                           "/1",
                           "1/2/3",
                           "6 0",
                           "1e3",
                           "nan",
                           "inf",
                           "60.0000000",
                           ".",
                           "+60",
                           "1.5.2",
                           "10001",
                           "1/3601",
                           "99999999999999999999",
                           "9999999999999",
                           "1/99999999999999999999",
                           "60x",
                           "0x10"})
    EXPECT_EQ(error_of([&] { (void)parse_rate(text); }).kind(), ErrorKind::Usage) << text;
}

TEST(Rate, TheRangeIncludesItsEnds) {
  EXPECT_EQ(make_rate(1, 3600), (Rate{1, 3600}));
  EXPECT_EQ(make_rate(10000, 1), (Rate{10000, 1}));
  EXPECT_EQ(error_of([] { (void)make_rate(1, 3601); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([] { (void)make_rate(10001, 1); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([] { (void)make_rate(20001, 2); }).kind(), ErrorKind::Usage);
}

TEST(Rate, HugeTermsDoNotOverflow) {
  const int64_t huge = std::numeric_limits<int64_t>::max();
  EXPECT_EQ(make_rate(huge, huge), (Rate{1, 1}));
  EXPECT_EQ(error_of([&] { (void)make_rate(huge, 1); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([&] { (void)make_rate(1, huge); }).kind(), ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::frames
