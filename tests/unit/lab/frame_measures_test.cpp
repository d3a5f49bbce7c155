// SPDX-License-Identifier: Apache-2.0
// Tests flicker.
#include <gtest/gtest.h>

#include "lab/measures.h"
#include "tests/support/error_matchers.h"
#include "tests/support/noise_frame.h"

namespace lenticule::lab {
namespace {

using frames::WovenFrame;
using test::error_of;

WovenFrame plus(WovenFrame frame, int levels) {
  for (uint8_t& byte : frame.bytes()) byte = static_cast<uint8_t>(byte + levels);
  return frame;
}

WovenFrame of_codes(const std::vector<uint8_t>& codes) {
  WovenFrame frame({.width = static_cast<int>(codes.size() / 3), .height = 1});
  std::copy(codes.begin(), codes.end(), frame.bytes().begin());
  return frame;
}

TEST(Flicker, IsTheChangeOfTheErrorAndNotTheError) {
  FlickerMeter meter;
  const Flicker first = meter.add(of_codes({10, 20, 30}).view(), of_codes({250, 20, 30}).view());
  EXPECT_EQ(first.largest, 0) << "there is nothing before it";
  EXPECT_EQ(first.mean, 0.0);
  // The errors were 240, 0, 0 and are now -60, 0, 3: changes of 300, 0 and 3.
  const Flicker second = meter.add(of_codes({100, 200, 77}).view(), of_codes({40, 200, 80}).view());
  EXPECT_EQ(second.largest, 300);
  EXPECT_DOUBLE_EQ(second.mean, 101.0);
  // The same errors on other pictures do not flicker.
  const Flicker third = meter.add(of_codes({90, 1, 2}).view(), of_codes({30, 1, 5}).view());
  EXPECT_EQ(third.largest, 0);
  EXPECT_EQ(third.mean, 0.0);
}

TEST(Flicker, EqualsAnErrorThatComesAndGoes) {
  const WovenFrame a = plus(WovenFrame({.width = 16, .height = 9}), 100);
  FlickerMeter meter;
  for (int n = 0; n < 6; ++n) {
    const Flicker now = meter.add(a.view(), plus(a, n % 2 * 7).view());
    EXPECT_EQ(now.largest, n == 0 ? 0 : 7);
    EXPECT_DOUBLE_EQ(now.mean, n == 0 ? 0.0 : 7.0);
  }
}

TEST(Flicker, RefusesAnotherSize) {
  FlickerMeter meter;
  const WovenFrame a = test::noise_frame(8, 8, 1);
  (void)meter.add(a.view(), a.view());
  const WovenFrame b = test::noise_frame(9, 8, 1);
  EXPECT_EQ(error_of([&] { (void)meter.add(b.view(), b.view()); }).kind(), ErrorKind::Input);
  EXPECT_EQ(error_of([&] { (void)meter.add(a.view(), b.view()); }).kind(), ErrorKind::Input);
}

}  // namespace
}  // namespace lenticule::lab
