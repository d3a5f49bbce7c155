// SPDX-License-Identifier: Apache-2.0
// Tests sequences that stay in the ring for a gapless loop.
#include <gtest/gtest.h>

#include <thread>

#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

using test::connect_to;
using test::push_frame;
using test::small_ring;
using test::SocketFolder;
using test::stamped_id;

class RingLoop : public testing::Test {
 protected:
  RingLoop() {
    RingOptions options = small_ring(folder_.socket());
    options.keep_for_loop = true;
    player_ = RingPlayer::open(options);
  }
  std::unique_ptr<RingRenderer> connect(std::optional<uint64_t> frame_count = {}) {
    return connect_to(
        *player_, folder_.socket(),
        {.name = "loop", .rig_fingerprint = {}, .rate = {}, .frame_count = frame_count});
  }
  void deliver(uint64_t frames) {
    const auto renderer = connect();
    for (uint64_t k = 0; k < frames; ++k) ASSERT_EQ(push_frame(*renderer, k, k), RingStatus::Ok);
    renderer->finish();
    player_->service();
  }
  /// Pulls and releases until End; returns the ids in order.
  std::vector<uint64_t> play_through() {
    std::vector<uint64_t> ids;
    AcquiredFrame frame;
    while (player_->pull(frame) == PullStatus::Ready) {
      ids.push_back(stamped_id(frame.frame.bytes).value_or(~uint64_t{0}));
      player_->release(frame.token);
    }
    return ids;
  }

  SocketFolder folder_;
  std::unique_ptr<RingPlayer> player_;
};

using Ids = std::vector<uint64_t>;

TEST_F(RingLoop, ReplaysASequenceThatFillsTheRingExactly) {
  deliver(4);
  EXPECT_EQ(play_through(), (Ids{0, 1, 2, 3}));
  EXPECT_EQ(player_->loop_obstacle(), "");
  ASSERT_TRUE(player_->rewind());
  EXPECT_EQ(play_through(), (Ids{0, 1, 2, 3}));
}

TEST_F(RingLoop, RewindsWhileTheLastFramesAreStillAcquired) {
  deliver(2);
  AcquiredFrame first, second, again;
  ASSERT_EQ(player_->pull(first), PullStatus::Ready);
  ASSERT_EQ(player_->pull(second), PullStatus::Ready);
  ASSERT_EQ(player_->pull(again), PullStatus::End);
  ASSERT_TRUE(player_->rewind());
  ASSERT_EQ(player_->pull(again), PullStatus::Ready);
  EXPECT_EQ(again.number, 0u);
  player_->release(first.token);
  EXPECT_EQ(stamped_id(again.frame.bytes), 0u);
  player_->release(second.token);
  player_->release(again.token);
  EXPECT_EQ(test::statistics_of(*player_).violations, 0u);
}

TEST_F(RingLoop, DoesNotRewindBeforeTheEnd) {
  deliver(2);
  EXPECT_FALSE(player_->rewind());
  AcquiredFrame frame;
  ASSERT_EQ(player_->pull(frame), PullStatus::Ready);
  EXPECT_FALSE(player_->rewind());
}

TEST_F(RingLoop, RecyclesOnceTheRendererAsksForMoreSlotsThanThereAre) {
  const auto renderer = connect();
  std::thread writer([&] {
    for (uint64_t k = 0; k < 20; ++k)
      if (push_frame(*renderer, k, k, std::chrono::seconds(20)) != RingStatus::Ok) return;
    renderer->finish();
  });
  Ids ids;
  const bool ended = test::service_until(*player_, [&] {
    AcquiredFrame frame;
    PullStatus status = PullStatus::NotYet;
    while ((status = player_->pull(frame)) == PullStatus::Ready) {
      ids.push_back(stamped_id(frame.frame.bytes).value_or(~uint64_t{0}));
      player_->release(frame.token);
    }
    return status == PullStatus::End;
  });
  writer.join();
  ASSERT_TRUE(ended);
  EXPECT_EQ(ids.size(), 20u);
  EXPECT_FALSE(player_->rewind());
  EXPECT_NE(player_->loop_obstacle().find("more frames than"), std::string::npos);
}

TEST_F(RingLoop, RecyclesFromTheStartWhenTheStatedCountDoesNotFit) {
  const auto renderer = connect(5);
  EXPECT_NE(player_->loop_obstacle(), "");
  ASSERT_EQ(push_frame(*renderer, 0, 0), RingStatus::Ok);
  EXPECT_EQ(play_through(), (Ids{0}));
  for (uint64_t k = 1; k < 5; ++k) ASSERT_EQ(push_frame(*renderer, k, k), RingStatus::Ok);
  renderer->finish();
  player_->service();
  EXPECT_EQ(play_through(), (Ids{1, 2, 3, 4}));
  EXPECT_FALSE(player_->rewind());
}

TEST_F(RingLoop, ANewRendererReplacesTheKeptSequence) {
  deliver(4);
  EXPECT_EQ(play_through(), (Ids{0, 1, 2, 3}));
  AcquiredFrame displayed;
  ASSERT_TRUE(player_->rewind());
  ASSERT_EQ(player_->pull(displayed), PullStatus::Ready);
  const auto renderer = connect();
  EXPECT_EQ(play_through(), (Ids{1, 2, 3})) << "the turn that has begun is played to its end";
  EXPECT_FALSE(player_->rewind());
  for (uint64_t k = 0; k < 3; ++k) ASSERT_EQ(push_frame(*renderer, k, 50 + k), RingStatus::Ok);
  renderer->finish();
  EXPECT_EQ(stamped_id(displayed.frame.bytes), 0u);
  player_->release(displayed.token);
  player_->service();
  EXPECT_EQ(play_through(), (Ids{50, 51, 52}));
  EXPECT_TRUE(player_->rewind());
}

TEST_F(RingLoop, KeepsASequenceThatTwoRenderersDelivered) {
  {
    const auto renderer = connect();
    ASSERT_EQ(push_frame(*renderer, 0, 0), RingStatus::Ok);
  }
  const auto renderer = connect();
  ASSERT_EQ(push_frame(*renderer, 1, 1), RingStatus::Ok);
  renderer->finish();
  player_->service();
  EXPECT_EQ(play_through(), (Ids{0, 1}));
  ASSERT_TRUE(player_->rewind());
  EXPECT_EQ(play_through(), (Ids{0, 1}));
}

}  // namespace
}  // namespace lenticule::frames
