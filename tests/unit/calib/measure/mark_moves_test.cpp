// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "calib/measure/frame_marks.h"

namespace lenticule::calib {
namespace {

/// Returns the moves of `count` pictures with a step before number `at`, and reading errors.
std::vector<Vec2> moves_with_step(size_t count, size_t at, Vec2 step) {
  std::vector<Vec2> moves;
  for (size_t n = 0; n < count; ++n) {
    const Vec2 error{0.04 * (static_cast<double>(n * 7 % 5) - 2.0) / 2.0,
                     0.03 * (static_cast<double>(n * 3 % 7) - 3.0) / 3.0};
    moves.push_back(error + (n < at ? Vec2{} : step));
  }
  return moves;
}

TEST(MarkMoves, FindTheFirstPictureAfterAKnock) {
  for (const size_t at : {size_t{4}, size_t{40}, size_t{71}}) {
    const std::optional<MarkStep> step = find_step(moves_with_step(75, at, {0.5, -0.3}));
    ASSERT_TRUE(step) << at;
    EXPECT_EQ(step->picture, at);
    EXPECT_NEAR(step->length_px, 0.58, 0.05);
  }
}

TEST(MarkMoves, AreReadingErrorsBelowAQuarterOfAPixel) {
  EXPECT_FALSE(find_step(moves_with_step(75, 40, {0.1, 0.1})));
  EXPECT_FALSE(find_step({}));
}

TEST(MarkMoves, NameTheTwoPhotographs) {
  EXPECT_EQ(moved_between(40), "the camera moved between photograph 40 and 41");
}

}  // namespace
}  // namespace lenticule::calib
