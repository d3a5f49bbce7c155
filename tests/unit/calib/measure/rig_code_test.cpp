// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "calib/measure/frame_marks.h"
#include "calib/measure/pattern.h"

namespace lenticule::calib {
namespace {

constexpr size_t kPatterns = 75;

RigCodeReadings readings_of(const RigCode& code) {
  RigCodeReadings readings;
  for (size_t n = 0; n < kPatterns; ++n) readings.add(code.of_pattern(n));
  return readings;
}

TEST(RigCode, ReadsTheFingerprintFromPicturesOfAllPatterns) {
  for (const char* fingerprint : {"0123456789abcdef", "ffffffffffffffff", "0000000000000001"}) {
    const RigCode code(fingerprint);
    const RigCodeReadings readings = readings_of(code);
    EXPECT_EQ(readings.fingerprint(), fingerprint);
    EXPECT_EQ(readings.first_foreign(code), std::nullopt);
    EXPECT_EQ(readings.read(), kPatterns - 4);
  }
}

TEST(RigCode, DetectsAndNamesAnotherRig) {
  const RigCode expected("0123456789abcdef"), other("0123456789abcdee");
  const RigCodeReadings readings = readings_of(other);
  EXPECT_TRUE(readings.first_foreign(expected));
  EXPECT_EQ(readings.fingerprint(), other.fingerprint());
}

TEST(RigCode, NamesTheFirstPictureOfAnotherRigInAMix) {
  const RigCode expected("0123456789abcdef"), other("76543210fedcba98");
  RigCodeReadings readings;
  for (size_t n = 0; n < kPatterns; ++n)
    readings.add(n == 37 ? other.of_pattern(n) : expected.of_pattern(n));
  ASSERT_NE(other.of_pattern(37), expected.of_pattern(37));
  EXPECT_EQ(readings.first_foreign(expected), size_t{37});
  EXPECT_EQ(readings.fingerprint(), std::nullopt);
}

TEST(RigCode, UnreadableMarksGiveNoFingerprint) {
  RigCodeReadings readings;
  for (size_t n = 0; n < kPatterns; ++n) readings.add(kNoCode);
  EXPECT_EQ(readings.read(), 0U);
  EXPECT_EQ(readings.fingerprint(), std::nullopt);
  EXPECT_EQ(readings.first_foreign(RigCode("0123456789abcdef")), std::nullopt);
}

}  // namespace
}  // namespace lenticule::calib
