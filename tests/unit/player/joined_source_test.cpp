// SPDX-License-Identifier: Apache-2.0
#include "player/sources/joined_source.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/fakes/fake_source.h"

namespace lenticule::player {
namespace {

using frames::AcquiredFrame;
using frames::PullStatus;
using test::FakeSource;
using test::FakeSourceScript;

constexpr frames::FrameGeometry kLeft{.width = 16, .height = 8};
constexpr frames::FrameGeometry kRight{.width = 6, .height = 4};
constexpr frames::FrameGeometry kBoth{.width = 22, .height = 8};

class Joined : public ::testing::Test {
 protected:
  /// Joins two sources of these scripts, whose sizes are set here.
  JoinedSource join(FakeSourceScript left_script, FakeSourceScript right_script) {
    left_script.geometry = kLeft;
    right_script.geometry = kRight;
    auto left_source = std::make_unique<FakeSource>(left_script);
    auto right_source = std::make_unique<FakeSource>(right_script);
    left = left_source.get();
    right = right_source.get();
    std::vector<JoinedSource::Part> parts;
    parts.push_back({"left", std::move(left_source)});
    parts.push_back({"right", std::move(right_source)});
    return {std::move(parts), kBoth};
  }
  static void expect_frame(const AcquiredFrame& frame, uint64_t number) {
    EXPECT_EQ(frame.number, number);
    EXPECT_EQ(frame.frame.geometry, kBoth);
    EXPECT_TRUE(frame.frame.bytes.empty());
    ASSERT_EQ(frame.frame.parts.size(), 2U);
    EXPECT_EQ(test::checksum_of(frame.frame.parts[0]),
              test::checksum_of(test::numbered_frame(kLeft, number).view()));
    EXPECT_EQ(test::checksum_of(frame.frame.parts[1]),
              test::checksum_of(test::numbered_frame(kRight, number).view()));
  }

  FakeSource* left = nullptr;
  FakeSource* right = nullptr;
};

TEST_F(Joined, FramesStayValidUntilEachIsReleasedInAnyOrder) {
  JoinedSource source = join({}, {});
  EXPECT_EQ(source.max_acquired(), 2);
  AcquiredFrame first, second;
  ASSERT_EQ(source.pull(first), PullStatus::Ready);
  ASSERT_EQ(source.pull(second), PullStatus::Ready);
  source.release(first.token);
  expect_frame(second, 1);
  source.release(second.token);
  EXPECT_EQ(left->acquired() + right->acquired(), 0U);
}

TEST_F(Joined, WaitsForTheSlowerPartAndTakesEachFrameOnce) {
  const auto clock = std::make_shared<display::SimulatedClock>();
  const auto late = [](uint64_t n) { return std::chrono::seconds(n + 1); };
  JoinedSource source = join({}, {.ready_at = late, .clock = clock});
  AcquiredFrame frame;
  EXPECT_EQ(source.pull(frame), PullStatus::NotYet);
  EXPECT_EQ(source.pull(frame), PullStatus::NotYet);
  EXPECT_EQ(source.ready_count(), 0U);
  EXPECT_EQ(left->acquired(), 1U);
  (void)clock->wait_until(std::chrono::seconds(1), -1);
  EXPECT_EQ(source.ready_count(), 1U);
  ASSERT_EQ(source.pull(frame), PullStatus::Ready);
  expect_frame(frame, 0);
}

TEST_F(Joined, APartThatFailsIsNamed) {
  JoinedSource source = join({}, {.fails_after = 1});
  AcquiredFrame frame;
  ASSERT_EQ(source.pull(frame), PullStatus::Ready);
  source.release(frame.token);
  EXPECT_EQ(source.pull(frame), PullStatus::Failed);
  EXPECT_EQ(source.failure(), "right: the fake source broke");
}

}  // namespace
}  // namespace lenticule::player
