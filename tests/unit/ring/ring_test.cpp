// SPDX-License-Identifier: Apache-2.0
// Tests a real player and a real renderer in one process.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>

#include <thread>

#include "base/error.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

using std::chrono::milliseconds;
using test::connect_to;
using test::push_frame;
using test::service_until;
using test::small_ring;
using test::SocketFolder;
using test::stamped_id;

class Ring : public testing::Test {
 protected:
  void open(const RingOptions& options) { player_ = RingPlayer::open(options); }
  void open() { open(small_ring(folder_.socket())); }
  std::unique_ptr<RingRenderer> connect(const RendererHello& hello = {}) {
    return connect_to(*player_, folder_.socket(), hello);
  }
  /// Services the player first, as its loop does.
  PullStatus pull(AcquiredFrame& frame) {
    player_->service();
    return player_->pull(frame);
  }

  SocketFolder folder_;
  std::unique_ptr<RingPlayer> player_;
};

TEST_F(Ring, PassesTheRenderersHelloToThePlayer) {
  open();
  EXPECT_EQ(player_->rate(), std::nullopt);
  const auto renderer = connect(
      {.name = "teapot", .rig_fingerprint = {}, .rate = Rate{24000, 1001}, .frame_count = 77});
  EXPECT_EQ(player_->rate(), (Rate{24000, 1001}));
  EXPECT_EQ(player_->frame_count(), 77u);
  EXPECT_EQ(test::statistics_of(*player_).renderer_name, "teapot");
}

TEST_F(Ring, GivesAnAbandonedSlotToTheNextFrame) {
  open();
  const auto renderer = connect();
  std::span<uint8_t> pixels;
  for (int i = 0; i < 20; ++i) {
    ASSERT_EQ(renderer->acquire(0, milliseconds(0), pixels), RingStatus::Ok);
    renderer->abandon();
  }
  EXPECT_EQ(push_frame(*renderer, 0, 5), RingStatus::Ok);
  AcquiredFrame frame;
  ASSERT_EQ(pull(frame), PullStatus::Ready);
  EXPECT_EQ(frame.number, 0u);
}

TEST_F(Ring, TimesOutWhenEverySlotIsTaken) {
  open();
  const auto renderer = connect();
  for (uint64_t k = 0; k < 4; ++k) ASSERT_EQ(push_frame(*renderer, k, k), RingStatus::Ok);
  EXPECT_EQ(push_frame(*renderer, 4, 4, milliseconds(1)), RingStatus::TimedOut);
  player_->service();
  EXPECT_TRUE(player_->saturated());
  EXPECT_EQ(player_->ready_count(), 4u);
}

TEST_F(Ring, WakesARendererThatWaitsForASlot) {
  open();
  const auto renderer = connect();
  for (uint64_t k = 0; k < 4; ++k) ASSERT_EQ(push_frame(*renderer, k, k), RingStatus::Ok);
  RingStatus status = RingStatus::TimedOut;
  std::thread waiting([&] { status = push_frame(*renderer, 4, 4, std::chrono::seconds(20)); });
  AcquiredFrame frame;
  ASSERT_EQ(pull(frame), PullStatus::Ready);
  player_->release(frame.token);
  waiting.join();
  EXPECT_EQ(status, RingStatus::Ok);
}

TEST_F(Ring, WakesThePlayerWhenAFrameIsPublished) {
  open();
  const auto renderer = connect();
  player_->service();
  pollfd query = {.fd = player_->wake_fd(), .events = POLLIN, .revents = 0};
  ASSERT_EQ(::poll(&query, 1, 0), 0) << "nothing has happened yet";
  ASSERT_EQ(push_frame(*renderer, 0, 0), RingStatus::Ok);
  EXPECT_EQ(::poll(&query, 1, 0), 1);
  player_->service();
  EXPECT_EQ(::poll(&query, 1, 0), 0) << "service() clears the wake-up";
}

TEST_F(Ring, HandsOutOneFrameLessThanItHasSlots) {
  open();
  const auto renderer = connect();
  for (uint64_t k = 0; k < 4; ++k) ASSERT_EQ(push_frame(*renderer, k, k), RingStatus::Ok);
  AcquiredFrame frame;
  for (int i = 0; i < player_->max_acquired(); ++i) ASSERT_EQ(pull(frame), PullStatus::Ready);
  EXPECT_EQ(player_->max_acquired(), 3);
  EXPECT_EQ(pull(frame), PullStatus::NotYet);
}

TEST_F(Ring, KeepsAnAcquiredFrameWhileOthersComeAndGo) {
  open();
  const auto renderer = connect();
  ASSERT_EQ(push_frame(*renderer, 0, 42), RingStatus::Ok);
  AcquiredFrame displayed;
  ASSERT_EQ(pull(displayed), PullStatus::Ready);
  for (uint64_t k = 1; k < 50; ++k) {
    ASSERT_EQ(push_frame(*renderer, k, k + 1000), RingStatus::Ok);
    AcquiredFrame frame;
    ASSERT_EQ(pull(frame), PullStatus::Ready);
    player_->release(frame.token);
  }
  EXPECT_EQ(stamped_id(displayed.frame.bytes), 42u);
}

TEST_F(Ring, EndsAfterTheFinMessageOnceAllFramesArePulled) {
  open();
  const auto renderer = connect();
  ASSERT_EQ(push_frame(*renderer, 0, 0), RingStatus::Ok);
  ASSERT_EQ(push_frame(*renderer, 1, 1), RingStatus::Ok);
  renderer->finish();
  AcquiredFrame frame;
  ASSERT_EQ(pull(frame), PullStatus::Ready);
  player_->release(frame.token);
  ASSERT_EQ(pull(frame), PullStatus::Ready);
  EXPECT_EQ(pull(frame), PullStatus::End);
  EXPECT_EQ(pull(frame), PullStatus::End);
  EXPECT_EQ(test::statistics_of(*player_).renderer_deaths, 0u);
  EXPECT_FALSE(test::statistics_of(*player_).renderer_connected);
}

TEST_F(Ring, FinishGivesUpAHalfWrittenFrame) {
  open();
  const auto renderer = connect();
  std::span<uint8_t> pixels;
  ASSERT_EQ(renderer->acquire(0, milliseconds(0), pixels), RingStatus::Ok);
  renderer->finish();
  AcquiredFrame frame;
  EXPECT_EQ(pull(frame), PullStatus::End);
  EXPECT_EQ(test::statistics_of(*player_).violations, 0u);
  EXPECT_EQ(renderer->acquire(1, milliseconds(0), pixels), RingStatus::Gone);
}

TEST_F(Ring, WaitsForTheNextRendererWhenOneLeavesWithoutGoodbye) {
  open();
  auto renderer = connect();
  ASSERT_EQ(push_frame(*renderer, 0, 7), RingStatus::Ok);
  renderer.reset();
  AcquiredFrame frame;
  ASSERT_EQ(pull(frame), PullStatus::Ready) << "what was published stays playable";
  EXPECT_EQ(stamped_id(frame.frame.bytes), 7u);
  EXPECT_EQ(pull(frame), PullStatus::NotYet);
  EXPECT_EQ(test::statistics_of(*player_).renderer_deaths, 1u);

  renderer = connect();
  ASSERT_EQ(push_frame(*renderer, 1, 8), RingStatus::Ok);
  ASSERT_EQ(pull(frame), PullStatus::Ready) << "the next one goes on with the same sequence";
  EXPECT_EQ(frame.number, 1u);
}

TEST_F(Ring, BeginsANewSequenceWithTheRendererAfterGoodbye) {
  open();
  AcquiredFrame frame;
  connect()->finish();
  EXPECT_EQ(pull(frame), PullStatus::End);
  const auto renderer = connect();
  EXPECT_EQ(pull(frame), PullStatus::NotYet);
  ASSERT_EQ(push_frame(*renderer, 0, 0), RingStatus::Ok);
  EXPECT_EQ(pull(frame), PullStatus::Ready);
}

TEST_F(Ring, ReportsEndOnceBetweenSequencesThatFollowClosely) {
  open();
  const auto first = connect();
  ASSERT_EQ(push_frame(*first, 0, 1), RingStatus::Ok);
  first->finish();
  const auto second = connect();
  ASSERT_EQ(push_frame(*second, 0, 2), RingStatus::Ok);
  AcquiredFrame frame;
  ASSERT_EQ(pull(frame), PullStatus::Ready);
  EXPECT_EQ(pull(frame), PullStatus::End);
  ASSERT_EQ(pull(frame), PullStatus::Ready);
  EXPECT_EQ(stamped_id(frame.frame.bytes), 2u);
  EXPECT_EQ(pull(frame), PullStatus::NotYet);
}

TEST_F(Ring, WakesAWaitingRendererWhenThePlayerGoes) {
  open();
  const auto renderer = connect();
  for (uint64_t k = 0; k < 4; ++k) ASSERT_EQ(push_frame(*renderer, k, k), RingStatus::Ok);
  RingStatus status = RingStatus::Ok;
  std::thread waiting([&] { status = push_frame(*renderer, 4, 4, std::chrono::hours(1)); });
  player_.reset();
  waiting.join();
  EXPECT_EQ(status, RingStatus::Gone);
}

TEST_F(Ring, RefusesASecondRendererWhileOneIsConnected) {
  open();
  const auto first =
      connect({.name = "first", .rig_fingerprint = {}, .rate = {}, .frame_count = {}});
  test::expect_error(test::error_of([this] {
                       (void)connect_to(*player_, folder_.socket(), {}, milliseconds(400));
                     }),
                     ErrorKind::Device, "busy: 'first'");
  EXPECT_EQ(push_frame(*first, 0, 0), RingStatus::Ok) << "the first one must not notice";
}

TEST_F(Ring, AcceptsAWaitingRendererWhenTheFirstOneEnds) {
  open();
  auto first = connect();
  std::unique_ptr<RingRenderer> second;
  std::thread waiting(
      [&] { second = RingRenderer::connect(folder_.socket(), {}, std::chrono::seconds(20)); });
  EXPECT_TRUE(
      service_until(*player_, [&] { return test::statistics_of(*player_).renderers_refused > 0; }));
  first.reset();
  EXPECT_TRUE(
      service_until(*player_, [&] { return test::statistics_of(*player_).renderers == 2; }));
  waiting.join();
  EXPECT_EQ(push_frame(*second, 0, 0), RingStatus::Ok);
}

TEST_F(Ring, RefusesFramesForAnotherRig) {
  RingOptions options = small_ring(folder_.socket());
  options.rig_fingerprint = "0123456789abcdef";
  open(options);
  for (const char* theirs : {"", "fedcba9876543210"}) {
    test::expect_error(
        test::error_of([&] {
          (void)connect({.name = "x", .rig_fingerprint = theirs, .rate = {}, .frame_count = {}});
        }),
        ErrorKind::Input, "0123456789abcdef");
  }
  EXPECT_NO_THROW((void)connect(
      {.name = "x", .rig_fingerprint = "0123456789abcdef", .rate = {}, .frame_count = {}}));
}

TEST_F(Ring, AcceptsFramesForAnotherTrimOfItsRigAndReportsIt) {
  RingOptions options = small_ring(folder_.socket());
  options.rig_fingerprint = "0123456789abcdef trims fedcba9876543210 0.01 0";
  std::vector<std::string> reported;
  options.on_other_trim = [&](const std::string& difference) { reported.push_back(difference); };
  open(options);
  for (const char* same : {"0123456789abcdef", "0123456789abcdef trims fedcba9876543210 0.01 0"})
    (void)connect({.name = "x", .rig_fingerprint = same, .rate = {}, .frame_count = {}});
  EXPECT_TRUE(reported.empty());
  for (const char* trimmed : {"fedcba9876543210", "beef trims fedcba9876543210 0.03 0"})
    (void)connect({.name = "x", .rig_fingerprint = trimmed, .rate = {}, .frame_count = {}});
  ASSERT_EQ(reported.size(), 2u);
  EXPECT_NE(reported[0].find("+0.01 lens"), std::string::npos) << reported[0];
  EXPECT_NE(reported[1].find("-0.02 lens"), std::string::npos) << reported[1];
  for (const char* other : {"beef", "fedcba9876543210 trims beef 0.01 0"})
    EXPECT_THROW(
        (void)connect({.name = "x", .rig_fingerprint = other, .rate = {}, .frame_count = {}}),
        Error);
}

TEST_F(Ring, HeartbeatMovesWhileTheRendererWorks) {
  open();
  const auto renderer = connect();
  const uint32_t before = test::statistics_of(*player_).heartbeat;
  ASSERT_EQ(push_frame(*renderer, 0, 0), RingStatus::Ok);
  EXPECT_NE(test::statistics_of(*player_).heartbeat, before);
}

TEST_F(Ring, RefusesImpossibleOptions) {
  const auto kind_of = [&](const RingOptions& options) {
    try {
      (void)RingPlayer::open(options);
    } catch (const Error& error) {
      return std::optional(error.kind());
    }
    return std::optional<ErrorKind>();
  };
  RingOptions options = small_ring(folder_.socket());
  options.slots = 2;
  EXPECT_EQ(kind_of(options), ErrorKind::Usage);
  options.slots = 4097;
  EXPECT_EQ(kind_of(options), ErrorKind::Usage);
  options = small_ring(folder_.socket());
  options.geometry.width = 0;
  EXPECT_EQ(kind_of(options), ErrorKind::Usage);
  options.geometry.width = 40000;
  EXPECT_EQ(kind_of(options), ErrorKind::Usage);
  options = small_ring(folder_.socket());
  options.geometry.format = PixelFormat::Rgb10;
  EXPECT_EQ(kind_of(options), ErrorKind::Usage);
  options = small_ring(folder_.socket());
  options.geometry = {.width = 32768, .height = 32768, .format = PixelFormat::Rgb8};
  options.slots = 4096;
  EXPECT_EQ(kind_of(options), ErrorKind::Failed) << "12 TiB are more than half of the memory";
}

/// The threads share only the ring, which a thread sanitizer run verifies.
TEST_F(Ring, TwoThreadsPassFramesWithoutTearing) {
  open();
  const auto renderer = connect();
  constexpr uint64_t kFrames = 3000;
  std::thread writer([&] {
    for (uint64_t k = 0; k < kFrames; ++k)
      if (push_frame(*renderer, k, k, std::chrono::seconds(20)) != RingStatus::Ok) break;
    renderer->finish();
  });
  uint64_t next = 0;
  AcquiredFrame displayed;
  const bool ended = service_until(*player_, [&] {
    AcquiredFrame frame;
    PullStatus status = PullStatus::NotYet;
    while ((status = player_->pull(frame)) == PullStatus::Ready) {
      EXPECT_EQ(frame.number, next);
      EXPECT_EQ(stamped_id(frame.frame.bytes), next);
      if (next++ > 0) player_->release(displayed.token);
      displayed = frame;
      EXPECT_EQ(stamped_id(displayed.frame.bytes), next - 1);
    }
    return status == PullStatus::End;
  });
  writer.join();
  EXPECT_TRUE(ended);
  EXPECT_EQ(next, kFrames);
  EXPECT_EQ(test::statistics_of(*player_).violations, 0u);
}

}  // namespace
}  // namespace lenticule::frames
