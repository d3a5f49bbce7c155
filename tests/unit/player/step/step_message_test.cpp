// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_message.h"

#include <gtest/gtest.h>

namespace lenticule::player {
namespace {

using std::chrono::nanoseconds;
using Refusal = StepKey::Refusal;

const StepKey kKey(std::vector<uint8_t>(32, 7));
const StepMessage kMessage{.kind = StepKind::Announcement,
                           .session = 0x0123456789ABCDEF,
                           .sent = nanoseconds(1'800'000'000'000'000'000),
                           .stepped = nanoseconds(-5),
                           .timeline = StepTimeline{.frame = 3,
                                                    .due = nanoseconds(1'800'000'000'500'000'000),
                                                    .rate = {24, 1},
                                                    .loop_frames = 8},
                           .in_step = true,
                           .difference = -123};

TEST(StepMessage, IsReadAsItWasWritten) {
  StepMessage without_timeline = kMessage;
  without_timeline.timeline.reset();
  for (const StepMessage& message : {kMessage, without_timeline, StepMessage{}}) {
    const auto opened = kKey.open(kKey.seal(message, "lobby"), "lobby");
    ASSERT_TRUE(opened.message);
    EXPECT_EQ(*opened.message, message);
  }
}

TEST(StepMessage, EveryChangedBitIsRefused) {
  const StepBytes bytes = kKey.seal(kMessage, "lobby");
  for (size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    StepBytes changed = bytes;
    changed[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
    EXPECT_FALSE(kKey.open(changed, "lobby").message) << "bit " << bit;
  }
}

TEST(StepMessage, AnotherKeyOrGroupIsRefused) {
  const StepBytes bytes = kKey.seal(kMessage, "lobby");
  for (const StepKey& other : {StepKey(std::vector<uint8_t>(32, 8)), StepKey()}) {
    EXPECT_FALSE(other.open(bytes, "lobby").message);
    EXPECT_EQ(other.open(bytes, "lobby").refusal, Refusal::Key);
  }
  EXPECT_FALSE(kKey.open(bytes, "hall").message);
  EXPECT_EQ(kKey.open(bytes, "hall").refusal, Refusal::Group);
}

TEST(StepMessage, AnAuthenticTimelineThatOverflowsIsRefused) {
  StepMessage message = kMessage;
  message.timeline->rate.denominator = 0;
  EXPECT_FALSE(kKey.open(kKey.seal(message, "lobby"), "lobby").message);
  message = kMessage;
  message.timeline->due += std::chrono::hours(25);
  EXPECT_FALSE(kKey.open(kKey.seal(message, "lobby"), "lobby").message);
  message = kMessage;
  message.sent = nanoseconds::max();
  EXPECT_FALSE(kKey.open(kKey.seal(message, "lobby"), "lobby").message);
}

}  // namespace
}  // namespace lenticule::player
