// SPDX-License-Identifier: Apache-2.0
// Tests malicious renderers: the player neither crashes nor hangs, and serves the next honest one.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <random>
#include <thread>

#include "base/error.h"
#include "frames/ring/ring_protocol.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

using test::knock;
using test::RawRenderer;
using test::serviced;

class RingMalice : public testing::Test {
 protected:
  std::unique_ptr<RawRenderer> raw() {
    std::unique_ptr<RawRenderer> renderer;
    serviced(*player_, [&] { renderer = std::make_unique<RawRenderer>(folder_.socket()); });
    return renderer;
  }
  /// Expects `frames` frames of an honest renderer to arrive undamaged.
  void expect_service_for_the_honest(uint64_t frames) {
    const auto honest = test::connect_to(*player_, folder_.socket());
    for (uint64_t k = 0; k < frames; ++k) {
      ASSERT_EQ(test::push_frame(*honest, k, k + 9), RingStatus::Ok);
      ASSERT_EQ(test::pull_all(*player_), std::vector{std::optional<uint64_t>(k + 9)});
    }
    honest->finish();
    player_->service();
  }
  uint64_t violations() const { return test::statistics_of(*player_).violations; }
  bool connected() const { return test::statistics_of(*player_).renderer_connected; }

  test::SocketFolder folder_;
  std::unique_ptr<RingPlayer> player_ = RingPlayer::open(test::small_ring(folder_.socket()));
};

TEST_F(RingMalice, CannotResizeOrResealTheMemory) {
  const auto renderer = raw();
  EXPECT_NE(::ftruncate(renderer->memory_fd(), 0), 0);
  EXPECT_NE(::ftruncate(renderer->memory_fd(), 1 << 30), 0);
  EXPECT_NE(::fcntl(renderer->memory_fd(), F_ADD_SEALS, F_SEAL_WRITE), 0);
}

TEST_F(RingMalice, HolesInTheMemoryDamageOnlyTheRenderersOwnFrames) {
  const auto renderer = raw();
  const size_t bytes = renderer->memory().size();
  ASSERT_TRUE(take_free_slot(renderer->table()[0], renderer->epoch()));
  ASSERT_TRUE(publish_slot(renderer->table()[0], renderer->epoch(), 0, 0));
  player_->service();
  ASSERT_EQ(::fallocate(renderer->memory_fd(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0,
                        static_cast<off_t>(bytes)),
            0);
  AcquiredFrame frame;
  ASSERT_EQ(player_->pull(frame), PullStatus::Ready);
  EXPECT_EQ(test::stamped_id(frame.frame.bytes), 0u) << "zeros, and no SIGBUS";
  player_->release(frame.token);
  EXPECT_GT(violations(), 0u);
  EXPECT_FALSE(connected()) << "the liar is sent away";
}

TEST_F(RingMalice, AnyInvalidSlotWordEndsTheConnection) {
  for (const uint32_t word : {0u, 0xffffffffu, 4u, 7u}) {
    player_.reset();
    player_ = RingPlayer::open(test::small_ring(folder_.socket()));
    const auto renderer = raw();
    renderer->table()[2].word = word;
    player_->service();
    EXPECT_EQ(violations(), 1u) << word;
    EXPECT_FALSE(connected());
    EXPECT_EQ(test::statistics_of(*player_).slots_shut, 1)
        << "the process lives and may be writing there";
    expect_service_for_the_honest(5);
  }
}

TEST_F(RingMalice, SlotsOfDisconnectedRenderersRunOutWithAReason) {
  for (int round = 0; round < 3; ++round) {
    const auto renderer = raw();
    int taken = 0;
    for (SlotEntry& entry : renderer->table())
      if (taken == 0 && take_free_slot(entry, renderer->epoch())) ++taken;
    ASSERT_EQ(taken, 1);
    renderer->hang_up();
    player_->service();
    ASSERT_EQ(test::statistics_of(*player_).slots_shut, round + 1);
  }
  test::expect_error(test::error_of([this] {
                       (void)test::connect_to(*player_, folder_.socket(), {},
                                              std::chrono::milliseconds(50));
                     }),
                     ErrorKind::Device, "hold 3 of 4 slots");
}

TEST_F(RingMalice, InvalidMessagesEndTheConnection) {
  std::mt19937 random(7);
  for (int round = 0; round < 50; ++round) {
    const auto renderer = raw();
    std::vector<uint8_t> junk(random() % 400);
    for (uint8_t& byte : junk) byte = static_cast<uint8_t>(random());
    ASSERT_EQ(send_bytes(renderer->socket(), junk), Transfer::Done);
    player_->service();
    EXPECT_FALSE(connected()) << junk.size() << " bytes";
  }
  EXPECT_EQ(test::statistics_of(*player_).slots_shut, 0);
  expect_service_for_the_honest(5);
}

TEST_F(RingMalice, AnInvalidHelloIsRefused) {
  std::mt19937 random(8);
  for (int round = 0; round < 50; ++round) {
    const UniqueFd socket = knock(folder_.socket());
    std::vector<uint8_t> junk(1 + random() % 400);
    for (uint8_t& byte : junk) byte = static_cast<uint8_t>(random());
    ASSERT_EQ(send_bytes(socket.get(), junk), Transfer::Done);
    player_->service();
    Packet packet;
    ASSERT_EQ(receive_packet(socket.get(), packet, PassedFds::Take), Transfer::Done);
    RefuseReason reason{};
    std::string text;
    EXPECT_EQ(read_refuse(packet.bytes(), reason, text), nullptr);
    EXPECT_EQ(reason, RefuseReason::BadHello) << text;
    EXPECT_FALSE(packet.fds[0]) << "no memory for strangers";
  }
  EXPECT_EQ(test::statistics_of(*player_).renderers, 0u);
  expect_service_for_the_honest(5);
}

TEST_F(RingMalice, ARefusedVersionLearnsThePlayersVersion) {
  const UniqueFd socket = knock(folder_.socket());
  HelloMessage hello = make_hello({});
  hello.prefix.version = 2;
  ASSERT_EQ(send_message(socket.get(), hello), Transfer::Done);
  player_->service();
  Packet packet;
  ASSERT_EQ(receive_packet(socket.get(), packet, PassedFds::Take), Transfer::Done);
  RefuseReason reason{};
  std::string text;
  ASSERT_EQ(read_refuse(packet.bytes(), reason, text), nullptr);
  EXPECT_EQ(reason, RefuseReason::OtherVersion);
  EXPECT_NE(text.find("version 1"), std::string::npos) << text;
}

TEST_F(RingMalice, SilentConnectionsDoNotBlockOthers) {
  std::vector<UniqueFd> silent;
  for (int i = 0; i < 64; ++i) {
    silent.push_back(knock(folder_.socket()));
    player_->service();
  }
  expect_service_for_the_honest(5);
}

TEST_F(RingMalice, AFloodOfMessagesDoesNotDelayThePlayer) {
  const auto renderer = raw();
  for (int round = 0; round < 50; ++round) {
    while (send_message(renderer->socket(), make_wake(MessageKind::Wanted)) == Transfer::Done) {
    }
    player_->service();  // bounded, or the test times out
  }
  EXPECT_TRUE(connected()) << "impolite, but nothing wrong";
  AcquiredFrame frame;
  EXPECT_EQ(player_->pull(frame), PullStatus::NotYet);
}

TEST_F(RingMalice, AnEventThatBlocksCannotBlockThePlayer) {
  const auto renderer = raw();
  // The flag belongs to the open file description that both processes share.
  ASSERT_EQ(::fcntl(renderer->published_event(), F_SETFL, 0), 0);
  const uint64_t most = UINT64_MAX - 1;
  for (int round = 0; round < 20; ++round) {
    uint64_t drained = 0;
    ASSERT_EQ(::write(renderer->published_event(), &most, sizeof most), 8);
    player_->service();
    ASSERT_EQ(::read(renderer->published_event(), &drained, sizeof drained), 8);
    player_->service();
  }
  EXPECT_TRUE(connected());
}

TEST_F(RingMalice, DescriptorsSentToThePlayerAreNotKept) {
  const auto open_fds = [] {
    const std::filesystem::directory_iterator fds("/proc/self/fd");
    return std::distance(begin(fds), end(fds));
  };
  const UniqueFd socket = knock(folder_.socket());
  player_->service();
  const auto before = open_fds();
  const std::array<int, 2> fds = {socket.get(), socket.get()};
  HelloMessage hello = make_hello({});
  hello.prefix.magic = 0;
  ASSERT_EQ(send_message(socket.get(), hello, fds), Transfer::Done);
  player_->service();
  EXPECT_LE(open_fds(), before);
}

/// Writes random words into header and table, sometimes plausible ones.
[[noreturn]] void scribble(const std::filesystem::path& socket, unsigned seed) {
  std::mt19937 random(seed);
  try {
    RawRenderer renderer(socket);
    const std::span<SlotEntry> table = renderer.table();
    uint8_t* header = renderer.memory().data();
    for (uint64_t order = 0;; ++order) {
      SlotEntry& entry = table[random() % table.size()];
      switch (random() % 6) {
        case 0:
          entry.word = static_cast<uint32_t>(random());
          break;
        case 1:
          entry.word = slot_word(static_cast<SlotState>(1 + random() % 4), renderer.epoch());
          break;
        case 2:
          entry.order = random() % 8;
          break;
        case 3:
          entry.frame_number = (uint64_t{random()} << 32) | random();
          break;
        case 4:
          header[random() % kHeaderBytes] = static_cast<uint8_t>(random());
          break;
        default:
          if (take_free_slot(entry, renderer.epoch()))
            (void)publish_slot(entry, renderer.epoch(), order, order);
      }
      if (random() % 64 == 0) (void)send_message(renderer.socket(), make_wake(MessageKind::Wanted));
    }
  } catch (const std::exception&) {
  }
  ::_exit(0);
}

TEST_F(RingMalice, SurvivesRandomWritesIntoTheSharedTable) {
  constexpr unsigned kScribblers = 60;
  for (unsigned round = 0; round < kScribblers; ++round) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) scribble(folder_.socket(), round);
    const uint64_t renderers = test::statistics_of(*player_).renderers;
    // The player holds a frame and polls slowly in half of the runs.
    AcquiredFrame kept;
    bool keeps = false;
    EXPECT_TRUE(test::service_until(*player_,
                                    [&] {
                                      AcquiredFrame frame;
                                      while (player_->pull(frame) == PullStatus::Ready) {
                                        if (keeps || round % 2 == 0) {
                                          player_->release(frame.token);
                                          continue;
                                        }
                                        kept = frame;
                                        keeps = true;
                                      }
                                      if (round % 2 == 1)
                                        std::this_thread::sleep_for(std::chrono::microseconds(200));
                                      return test::statistics_of(*player_).renderers > renderers &&
                                             !connected();
                                    }))
        << "round " << round;
    ::kill(child, SIGKILL);
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    if (keeps) player_->release(kept.token);
    EXPECT_TRUE(test::service_until(*player_,
                                    [&] { return test::statistics_of(*player_).slots_shut == 0; }));
  }
  EXPECT_GE(violations(), kScribblers / 2);
  (void)test::pull_all(*player_);
  expect_service_for_the_honest(20);
}

}  // namespace
}  // namespace lenticule::frames
