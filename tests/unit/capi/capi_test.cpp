// SPDX-License-Identifier: Apache-2.0
// Tests lenticule.h against a real player.
#include <gtest/gtest.h>
#include <lenticule.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <future>
#include <string>
#include <thread>

#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

using test::service_until;
using test::small_ring;
using test::SocketFolder;

class CApi : public testing::Test {
 protected:
  void TearDown() override { lenticule_ring_close(ring_); }

  lenticule_status connect(const lenticule_hello* hello, int timeout_ms = 10000) {
    auto status = std::async(std::launch::async, [&] {
      const auto result =
          lenticule_ring_connect(folder_.socket().c_str(), hello, timeout_ms, &ring_);
      error_ = lenticule_last_error();
      return result;
    });
    EXPECT_TRUE(service_until(*player_, [&] {
      return status.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    }));
    return status.get();
  }

  SocketFolder folder_;
  RingOptions options_ = small_ring(folder_.socket());
  std::unique_ptr<RingPlayer> player_ = RingPlayer::open(options_);
  lenticule_ring* ring_ = nullptr;
  std::string error_;
};

TEST_F(CApi, PushesFrames) {
  ASSERT_EQ(connect(nullptr), LENTICULE_OK) << error_;
  EXPECT_EQ(lenticule_ring_width(ring_), 160);
  EXPECT_EQ(lenticule_ring_height(ring_), 120);
  EXPECT_EQ(lenticule_ring_format(ring_), LENTICULE_RGB8);
  EXPECT_EQ(lenticule_ring_stride(ring_), 480u);
  EXPECT_EQ(lenticule_ring_frame_bytes(ring_), 57600u);
  EXPECT_EQ(lenticule_ring_slots(ring_), 4);
  for (uint64_t k = 0; k < 10; ++k) {
    uint8_t* pixels = nullptr;
    ASSERT_EQ(lenticule_ring_acquire(ring_, k, 0, &pixels), LENTICULE_OK);
    test::stamp_frame({pixels, lenticule_ring_frame_bytes(ring_)}, k + 3);
    ASSERT_EQ(lenticule_ring_publish(ring_), LENTICULE_OK);
    AcquiredFrame frame;
    ASSERT_EQ(player_->pull(frame), PullStatus::Ready);
    EXPECT_EQ(test::stamped_id(frame.frame.bytes), k + 3);
    player_->release(frame.token);
  }
  EXPECT_EQ(lenticule_ring_finish(ring_), LENTICULE_OK);
  AcquiredFrame frame;
  player_->service();
  EXPECT_EQ(player_->pull(frame), PullStatus::End);
}

TEST_F(CApi, TellsWhereTheViewsLie) {
  player_.reset();
  options_.content = {
      .kind = RingContent::Quilt, .columns = 3, .rows = 2, .views = 5, .aspect = 1.5};
  player_ = RingPlayer::open(options_);
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  EXPECT_EQ(connect(&hello), LENTICULE_REFUSED);
  EXPECT_NE(error_.find("the player takes views of 160x120 pixels"), std::string::npos) << error_;
  hello.struct_size = offsetof(lenticule_hello, pushes_views);  // a program of an earlier version
  hello.pushes_views = 1;
  EXPECT_EQ(connect(&hello), LENTICULE_REFUSED) << "a member that it does not have is not read";
  hello.struct_size = sizeof hello;
  ASSERT_EQ(connect(&hello), LENTICULE_OK) << error_;
  EXPECT_EQ(lenticule_ring_views(ring_), 5);
  EXPECT_EQ(lenticule_ring_has_depth(ring_), 0);
  EXPECT_EQ(lenticule_ring_view_aspect(ring_), 1.5);
  const auto place = [&](int view) {
    lenticule_rect rect{};
    EXPECT_EQ(lenticule_ring_view(ring_, view, &rect), LENTICULE_OK);
    return std::array{rect.x, rect.y, rect.width, rect.height};
  };
  EXPECT_EQ(place(0), (std::array{0, 60, 53, 60})) << "the bottom left";
  EXPECT_EQ(place(2), (std::array{106, 60, 53, 60}));
  EXPECT_EQ(place(4), (std::array{53, 0, 53, 60}));
  lenticule_rect rect;
  EXPECT_EQ(lenticule_ring_view(ring_, 5, &rect), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_view(ring_, -1, &rect), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_view(ring_, 0, nullptr), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_view(nullptr, 0, &rect), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_views(nullptr), 0);
}

TEST_F(CApi, TellsWhereColoursAndDepthLie) {
  player_.reset();
  options_.content = {.kind = RingContent::Colours,
                      .colours = {.width = 80, .height = 120},
                      .depth = {.left = 80, .width = 80, .height = 120}};
  player_ = RingPlayer::open(options_);
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  hello.pushes_views = 1;
  ASSERT_EQ(connect(&hello), LENTICULE_OK) << error_;
  EXPECT_EQ(lenticule_ring_has_depth(ring_), 1);
  EXPECT_EQ(lenticule_ring_views(ring_), 2);
  lenticule_rect depth{};
  ASSERT_EQ(lenticule_ring_view(ring_, 1, &depth), LENTICULE_OK);
  EXPECT_EQ(depth.x, 80);
  EXPECT_EQ(depth.width, 80);
}

TEST_F(CApi, APlayerOfWovenFramesRefusesViews) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  hello.pushes_views = 1;
  EXPECT_EQ(connect(&hello), LENTICULE_REFUSED);
  EXPECT_NE(error_.find("takes woven frames of 160x120"), std::string::npos) << error_;
}

TEST_F(CApi, PassesTheHelloToThePlayer) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  hello.name = "example renderer";
  hello.rate_numerator = 60000;
  hello.rate_denominator = 1001;
  hello.frame_count = 0;
  ASSERT_EQ(connect(&hello), LENTICULE_OK) << error_;
  EXPECT_EQ(test::statistics_of(*player_).renderer_name, "example renderer");
  EXPECT_EQ(player_->rate(), (Rate{60000, 1001}));
  EXPECT_EQ(player_->frame_count(), 0u);
}

TEST_F(CApi, ReportsWhyItCannotConnect) {
  EXPECT_EQ(lenticule_ring_connect((folder_.folder() / "none").c_str(), nullptr, 0, &ring_),
            LENTICULE_NO_PLAYER);
  EXPECT_EQ(ring_, nullptr);
  EXPECT_NE(std::string(lenticule_last_error()).find("no player listens"), std::string::npos);
  EXPECT_EQ(lenticule_ring_connect(std::string(200, 'x').c_str(), nullptr, 0, &ring_),
            LENTICULE_MISUSE);
  EXPECT_NE(std::string(lenticule_last_error()).find("too long"), std::string::npos);
}

TEST_F(CApi, ReportsARefusal) {
  player_.reset();
  options_.rig_fingerprint = "0123456789abcdef";
  player_ = RingPlayer::open(options_);
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  hello.rig_fingerprint = "beef";
  EXPECT_EQ(connect(&hello), LENTICULE_REFUSED);
  EXPECT_NE(error_.find("0123456789abcdef"), std::string::npos) << error_;
}

TEST_F(CApi, RejectsAnInvalidHello) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  hello.struct_size = 1;
  EXPECT_EQ(connect(&hello), LENTICULE_MISUSE);
  hello = LENTICULE_HELLO_INIT;
  hello.rate_numerator = -1;
  EXPECT_EQ(connect(&hello), LENTICULE_MISUSE);
  hello = LENTICULE_HELLO_INIT;
  const std::string long_name(64, 'n');
  hello.name = long_name.c_str();
  EXPECT_EQ(connect(&hello), LENTICULE_MISUSE);
  EXPECT_EQ(connect(nullptr), LENTICULE_OK);
}

TEST_F(CApi, ReportsMisuseWithoutCrashing) {
  uint8_t* pixels = nullptr;
  EXPECT_EQ(lenticule_ring_connect(nullptr, nullptr, 0, &ring_), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_connect("x", nullptr, 0, nullptr), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_acquire(nullptr, 0, 0, &pixels), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_publish(nullptr), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_finish(nullptr), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_width(nullptr), 0);

  ASSERT_EQ(connect(nullptr), LENTICULE_OK);
  EXPECT_EQ(lenticule_ring_publish(ring_), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_abandon(ring_), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_acquire(ring_, 5, 0, nullptr), LENTICULE_MISUSE);
  ASSERT_EQ(lenticule_ring_acquire(ring_, 5, 0, &pixels), LENTICULE_OK);
  EXPECT_EQ(lenticule_ring_acquire(ring_, 6, 0, &pixels), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_abandon(ring_), LENTICULE_OK);
  ASSERT_EQ(lenticule_ring_acquire(ring_, 5, 0, &pixels), LENTICULE_OK);
  ASSERT_EQ(lenticule_ring_publish(ring_), LENTICULE_OK);
  EXPECT_EQ(lenticule_ring_acquire(ring_, 5, 0, &pixels), LENTICULE_MISUSE)
      << "numbers must increase";
  EXPECT_EQ(lenticule_ring_finish(ring_), LENTICULE_OK);
  EXPECT_EQ(lenticule_ring_finish(ring_), LENTICULE_MISUSE);
  EXPECT_EQ(lenticule_ring_acquire(ring_, 6, 0, &pixels), LENTICULE_GONE);
  player_->service();
  EXPECT_EQ(test::statistics_of(*player_).violations, 0u);
}

TEST_F(CApi, ReportsTimeoutsAndALostPlayer) {
  ASSERT_EQ(connect(nullptr), LENTICULE_OK);
  uint8_t* pixels = nullptr;
  for (uint64_t k = 0; k < 4; ++k) {
    ASSERT_EQ(lenticule_ring_acquire(ring_, k, 0, &pixels), LENTICULE_OK);
    ASSERT_EQ(lenticule_ring_publish(ring_), LENTICULE_OK);
  }
  EXPECT_EQ(lenticule_ring_acquire(ring_, 4, 1, &pixels), LENTICULE_TIMED_OUT);
  EXPECT_EQ(pixels, nullptr);
  player_.reset();
  EXPECT_EQ(lenticule_ring_acquire(ring_, 4, 1, &pixels), LENTICULE_GONE);
  EXPECT_EQ(lenticule_ring_finish(ring_), LENTICULE_OK) << "no player is left to hear it";
}

TEST_F(CApi, KeepsOneErrorPerThread) {
  EXPECT_EQ(lenticule_ring_publish(nullptr), LENTICULE_MISUSE);
  const std::string mine = lenticule_last_error();
  std::thread([] {
    EXPECT_STREQ(lenticule_last_error(), "");
    EXPECT_EQ(lenticule_ring_finish(nullptr), LENTICULE_MISUSE);
  }).join();
  EXPECT_EQ(lenticule_last_error(), mine);
}

TEST_F(CApi, StatesItsVersion) {
  const std::string version = std::to_string(LENTICULE_VERSION_MAJOR) + "." +
                              std::to_string(LENTICULE_VERSION_MINOR) + "." +
                              std::to_string(LENTICULE_VERSION_PATCH);
  EXPECT_EQ(lenticule_version(), version) << "header and build system disagree";
}

TEST_F(CApi, TheDocumentedExampleRuns) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::execl(PUSH_FRAMES_EXAMPLE, PUSH_FRAMES_EXAMPLE, folder_.socket().c_str(), "20", nullptr);
    ::_exit(127);
  }
  uint64_t shown = 0;
  const bool ended = service_until(*player_, [&] {
    AcquiredFrame frame;
    PullStatus status = PullStatus::NotYet;
    while ((status = player_->pull(frame)) == PullStatus::Ready) {
      EXPECT_EQ(frame.number, shown);
      EXPECT_EQ(frame.frame.row(119)[3 * 7 + 1], (7 + 4 * shown) % 256);
      ++shown;
      player_->release(frame.token);
    }
    return status == PullStatus::End;
  });
  if (!ended) ::kill(child, SIGKILL);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(ended);
  EXPECT_EQ(shown, 20u);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_EQ(test::statistics_of(*player_).renderer_name, "push_frames");
}

TEST(CApiExample, FailsWithAMessageWithoutAPlayer) {
  // The example waits five seconds for a player; an impossible path fails at once.
  const std::string command =
      std::string(PUSH_FRAMES_EXAMPLE) + " " + std::string(200, 'x') + " 1 2>/dev/null";
  const int status = std::system(command.c_str());
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1);
}

}  // namespace
}  // namespace lenticule::frames
