// SPDX-License-Identifier: Apache-2.0
#include "base/numbers.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace lenticule {
namespace {

TEST(NumberFrom, ReadsWholeAndDecimalNumbers) {
  EXPECT_EQ(number_from<int>("-12"), -12);
  EXPECT_EQ(number_from<uint64_t>("18446744073709551615"), UINT64_MAX);
  EXPECT_EQ(number_from<uint16_t>("beEF", 16), 0xBEEF);
  EXPECT_EQ(number_from<double>("-0.25e1"), -2.5);
}

TEST(NumberFrom, RefusesTextsThatAreNotWhollyANumber) {
  for (const char* text : {"", " 1", "1 ", "+1", "1x", "x", "0x1", "--1", "1.", "1\n"})
    EXPECT_EQ(number_from<int>(text), std::nullopt) << "'" << text << "'";
  for (const char* text : {"", " 1", "+1", "1,5", "inf", "-infinity", "nan", "1e999", "0x1p3"})
    EXPECT_EQ(number_from<double>(text), std::nullopt) << "'" << text << "'";
}

TEST(NumberFrom, RefusesNumbersOutsideTheType) {
  EXPECT_EQ(number_from<uint16_t>("65536"), std::nullopt);
  EXPECT_EQ(number_from<uint64_t>("-1"), std::nullopt);
  EXPECT_EQ(number_from<int>("2147483648"), std::nullopt);
}

TEST(TakeNumber, RemovesTheNumberOnly) {
  std::string_view text = "12px";
  EXPECT_EQ(take_number<int>(text), 12);
  EXPECT_EQ(text, "px");
  EXPECT_EQ(take_number<int>(text), std::nullopt);
  EXPECT_EQ(text, "px") << "unchanged";
  std::string_view name = "0.75e5";
  EXPECT_EQ(take_number<double>(name, std::chars_format::fixed), 0.75);
  EXPECT_EQ(name, "e5");
}

TEST(NumbersFrom, ReadsExactlyAsManyAsWanted) {
  EXPECT_EQ((numbers_from<int, 2>("1920x1080", 'x')), (std::array{1920, 1080}));
  EXPECT_EQ((numbers_from<double, 3>("0,1.5,-2", ',')), (std::array{0.0, 1.5, -2.0}));
  for (const char* text : {"", "1", "1x", "x1", "1x2x", "1x2x3", "1 x 2", "1xx2", "1X2"})
    EXPECT_EQ((numbers_from<int, 2>(text, 'x')), std::nullopt) << "'" << text << "'";
}

TEST(TakeUntil, SplitsAtTheFirstSeparator) {
  std::string_view text = "a:b:c";
  EXPECT_EQ(take_until(text, ':'), "a");
  EXPECT_EQ(text, "b:c");
  text = "abc";
  EXPECT_EQ(take_until(text, ':'), "abc");
  EXPECT_EQ(text, "");
}

}  // namespace
}  // namespace lenticule
