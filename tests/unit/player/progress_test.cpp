// SPDX-License-Identifier: Apache-2.0
#include "player/process/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lenticule::player {
namespace {

TEST(Progress, UnitsThatWereDoneBeforeAreNoPartOfTheRate) {
  testing::internal::CaptureStderr();
  Progress progress("render", "frames", 10);
  progress.update(8, {}, 8);
  progress.finish();
  EXPECT_THAT(testing::internal::GetCapturedStderr(), testing::HasSubstr("8/10 frames, 0.00/s"));
}

}  // namespace
}  // namespace lenticule::player
