// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_member.h"

#include <gtest/gtest.h>

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

const StepKey kKey(std::vector<uint8_t>(32, 7));

StepIdentity identity(uint64_t session) {
  return {.group = "lobby", .key = kKey, .session = session};
}
StepNow at(nanoseconds time, nanoseconds stepped = nanoseconds{0}) {
  return {.monotonic = time, .group = seconds(1000) + time, .stepped = stepped};
}
/// A player that shows frame 0 of 100 at `time`.
StepPlace playing(nanoseconds time) {
  return {.started = 1, .next_due_ns = time.count(), .rate = {50, 1}, .loop_frames = 100};
}
StepBytes announcement(uint64_t session, nanoseconds sent, uint64_t frame = 0) {
  return kKey.seal(
      {.kind = StepKind::Announcement,
       .session = session,
       .sent = seconds(1000) + sent,
       .timeline =
           StepTimeline{
               .frame = frame, .due = seconds(1000) + sent, .rate = {50, 1}, .loop_frames = 100}},
      "lobby");
}

TEST(StepFollower, RefusesAndCountsReplayedAndOvertakenMessages) {
  StepFollower follower(identity(2));
  EXPECT_TRUE(follower.receive(announcement(1, seconds(2)), at(seconds(2))));
  EXPECT_FALSE(follower.receive(announcement(1, seconds(2), 50), at(seconds(2))));
  EXPECT_FALSE(follower.receive(announcement(1, milliseconds(1900), 50), at(seconds(2))));
  EXPECT_EQ(follower.counts().refused_replayed, 2u);
  EXPECT_EQ(follower.timeline()->lateness(0, seconds(1002)), nanoseconds{0});
}

TEST(StepFollower, RefusesAndCountsOldMessagesAndThoseFromTheFuture) {
  StepFollower follower(identity(2));
  EXPECT_FALSE(follower.receive(announcement(1, seconds(1)), at(milliseconds(1300))));
  EXPECT_EQ(follower.untimely_age(), milliseconds(300));
  EXPECT_FALSE(follower.receive(announcement(1, milliseconds(1310)), at(milliseconds(1300))));
  EXPECT_EQ(follower.counts().refused_untimely, 2u);
  EXPECT_FALSE(follower.timeline());
}

TEST(StepFollower, ARecordedSessionIsRefusedAfterTheLeaderIsGone) {
  StepFollower follower(identity(2));
  const StepBytes recorded = announcement(1, seconds(1), 7);
  EXPECT_TRUE(follower.receive(recorded, at(seconds(1))));
  EXPECT_FALSE(follower.receive(recorded, at(seconds(60))));
  EXPECT_FALSE(follower.receive(announcement(9, milliseconds(500), 7), at(seconds(60))));
  EXPECT_EQ(follower.counts().accepted, 1u);
}

TEST(StepFollower, IgnoresASecondLeaderWhileTheFirstIsAlive) {
  StepFollower follower(identity(2));
  EXPECT_TRUE(follower.receive(announcement(1, seconds(1)), at(seconds(1))));
  EXPECT_FALSE(follower.receive(announcement(3, seconds(2), 50), at(seconds(2))));
  EXPECT_EQ(follower.counts().refused_stranger, 1u);
  EXPECT_TRUE(follower.receive(announcement(3, seconds(4), 50), at(seconds(4))));
}

TEST(StepFollower, ACorrectedClockAgreesWithTheLeadersAgain) {
  StepFollower follower(identity(2));
  StepNow wrong = at(seconds(1));
  wrong.group -= seconds(3);
  EXPECT_FALSE(follower.receive(announcement(1, seconds(1)), wrong));
  StepNow corrected = at(seconds(2), seconds(3));
  corrected.group -= seconds(3);
  EXPECT_TRUE(follower.receive(announcement(1, seconds(2)), corrected));
  EXPECT_EQ(follower.timeline()->lateness(0, seconds(1002) - seconds(3)), nanoseconds{0});
}

/// A player of which the clock was 2 s behind when it started.
StepNow two_seconds_behind(nanoseconds time) {
  StepNow now = at(time);
  now.group -= seconds(2);
  return now;
}

TEST(StepFollower, ForgetsACopyThatSuitedItsWrongClock) {
  StepFollower follower(identity(2));
  EXPECT_TRUE(follower.receive(announcement(1, seconds(3)), two_seconds_behind(seconds(5))));
  EXPECT_TRUE(follower.timeline());
  EXPECT_FALSE(follower.receive(announcement(1, seconds(5)), two_seconds_behind(seconds(5))));
  EXPECT_FALSE(follower.timeline());
  EXPECT_FALSE(follower.receive(announcement(1, milliseconds(3100)),
                                two_seconds_behind(milliseconds(5100))));
  EXPECT_EQ(follower.counts().refused_replayed, 1u);
}

TEST(StepLeader, TakesNoTimelineFromACopyThatSuitsItsWrongClock) {
  for (const bool copy_first : {false, true}) {
    StepFollower follower(identity(2));
    EXPECT_TRUE(follower.receive(announcement(1, seconds(1), 30), at(seconds(1))));
    const auto copy = follower.tick({}, at(seconds(3)));
    const auto fresh = follower.tick({}, at(seconds(5)));
    StepLeader leader(identity(5), two_seconds_behind(seconds(5)));
    EXPECT_EQ(
        leader.receive(copy_first ? *copy : *fresh, two_seconds_behind(seconds(5))).has_value(),
        copy_first);
    EXPECT_FALSE(leader.tick(playing(seconds(5)), two_seconds_behind(seconds(5))));
    EXPECT_FALSE(leader.receive(copy_first ? *fresh : *copy, two_seconds_behind(seconds(5))));
    EXPECT_FALSE(leader.tick(playing(seconds(6)), two_seconds_behind(seconds(6)))) << copy_first;
  }
}

TEST(StepLeader, ListensBeforeItBeginsATimeline) {
  StepLeader leader(identity(1), at(seconds(0)));
  EXPECT_FALSE(leader.tick(playing({}), at(milliseconds(400))));
  EXPECT_FALSE(leader.tick({}, at(milliseconds(600))));
  EXPECT_TRUE(leader.tick(playing(milliseconds(620)), at(milliseconds(600))));
  EXPECT_EQ(leader.timeline()->lateness(0, seconds(1000) + milliseconds(620)), nanoseconds{0});
}

TEST(StepLeader, BeginsAnotherTimelineForAnotherFilm) {
  StepFollower follower(identity(2));
  EXPECT_TRUE(follower.receive(announcement(1, seconds(1), 30), at(seconds(1))));
  StepLeader leader(identity(5), at(seconds(5)));
  EXPECT_TRUE(leader.receive(*follower.tick({}, at(milliseconds(5100))), at(milliseconds(5100))));
  StepPlace place = playing(seconds(6));
  place.loop_frames = 77;
  EXPECT_TRUE(leader.tick(place, at(seconds(6))));
  EXPECT_EQ(leader.timeline()->loop_frames, 77u);
}

TEST(StepLeader, BeginsNoTimelineWhileItsClockDisagreesWithTheGroup) {
  StepFollower follower(identity(2));
  EXPECT_TRUE(follower.receive(announcement(1, seconds(1), 30), at(seconds(1))));
  StepLeader leader(identity(5), at(seconds(5)));
  StepNow wrong = at(seconds(6));
  wrong.group += seconds(2);
  EXPECT_FALSE(leader.receive(*follower.tick({}, at(seconds(6))), wrong));
  EXPECT_FALSE(leader.tick(playing(seconds(6)), wrong));
}

TEST(StepLeader, KnowsHowFarItsPlayersAreApart) {
  StepLeader leader(identity(1), at(seconds(0)));
  StepFollower follower(identity(2));
  const StepPlace place{.in_step = 1, .difference = -300'000};
  EXPECT_TRUE(leader.receive(*follower.tick(place, at(seconds(1))), at(seconds(1))));
  StepPlace own = playing(seconds(1));
  own.in_step = 1;
  own.difference = 400'000;
  EXPECT_EQ(leader.apart(own, at(seconds(1))), 700'000);
  EXPECT_EQ(leader.apart(own, at(seconds(9))), 0);
}

TEST(StepLeader, RefusesMoreFollowersThanItHasPlacesFor) {
  StepLeader leader(identity(1), at(seconds(0)));
  for (uint64_t k = 0; k < StepLeader::kMaxFollowers + 3; ++k) {
    StepFollower follower(identity(100 + k));
    (void)leader.receive(*follower.tick({}, at(seconds(1))), at(seconds(1)));
  }
  EXPECT_EQ(leader.peers(at(seconds(1))), StepLeader::kMaxFollowers);
  EXPECT_EQ(leader.counts().refused_stranger, 3u);
}

}  // namespace
}  // namespace lenticule::player
