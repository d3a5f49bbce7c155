// SPDX-License-Identifier: Apache-2.0
// Tests two processes; either is killed or stopped at random times, and the other must continue.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <random>
#include <thread>

#include "base/error.h"
#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using test::SocketFolder;
using test::stamped_id;

constexpr int kKillsOfEach = 100;

/// The time of a kill. Every fourth process is killed at any time from its start (also before and
/// during the handshake); the others after some frames were shown and a random delay, so that on a
/// slow machine, too, most processes deliver frames.
struct Fate {
  Fate(int round, std::mt19937& random)
      : any_moment(round % 4 == 0),
        frames(any_moment ? 0 : 1 + random() % 4),
        then(random() % (any_moment ? 10000 : 2000)) {}
  bool any_moment;
  uint64_t frames;
  microseconds then;
};

/// Returns a ring whose frames take a while to write, so that most kills hit a half-written frame.
RingOptions busy_ring(const std::filesystem::path& socket) {
  RingOptions options = test::small_ring(socket);
  options.geometry = {.width = 640, .height = 480, .format = PixelFormat::Rgb8};
  return options;
}

/// A child process that runs `body` and is dead at the end of the scope.
class Child {
 public:
  template <typename Body>
  explicit Child(Body body) : pid_(::fork()) {
    if (pid_ != 0) return;
    try {
      body();
    } catch (const std::exception&) {
    }
    ::_exit(0);
  }
  ~Child() { kill_and_reap(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void send(int signal) const { ::kill(pid_, signal); }
  /// Waits until the process has stopped.
  void stop() const {
    send(SIGSTOP);
    ::waitpid(pid_, nullptr, WUNTRACED);
  }
  void kill_and_reap() {
    if (pid_ <= 0) return;
    send(SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_;
};

/// Connects and pushes frames as fast as slots become free, until player or renderer dies.
void render_for_ever(const std::filesystem::path& socket, uint64_t first_id) {
  const auto renderer = RingRenderer::connect(socket, {}, std::chrono::seconds(20));
  for (uint64_t k = 0;; ++k)
    if (test::push_frame(*renderer, k, first_id + k, std::chrono::seconds(20)) != RingStatus::Ok)
      return;
}

/// Plays incoming frames as a player does: one frame stays displayed until the next is available.
class Screen {
 public:
  explicit Screen(RingPlayer& player) : player_(player) {}
  ~Screen() { clear(); }

  void refresh() {
    player_.service();
    AcquiredFrame next;
    while (player_.pull(next) == PullStatus::Ready) {
      const auto id = stamped_id(next.frame.bytes);
      if (!id) ++torn_;
      if (id && displayed_ && id_ && *id <= *id_) ++out_of_order_;
      clear();
      displayed_ = next;
      id_ = id;
      ++shown_;
    }
    if (displayed_ && stamped_id(displayed_->frame.bytes) != id_) ++torn_;
  }

  [[nodiscard]] uint64_t shown() const { return shown_; }
  [[nodiscard]] uint64_t torn() const { return torn_; }
  [[nodiscard]] uint64_t out_of_order() const { return out_of_order_; }
  [[nodiscard]] bool holds_whole_frame() const {
    return displayed_ && stamped_id(displayed_->frame.bytes) == id_ && id_;
  }

 private:
  void clear() {
    if (displayed_) player_.release(displayed_->token);
    displayed_.reset();
  }

  RingPlayer& player_;
  std::optional<AcquiredFrame> displayed_;
  std::optional<uint64_t> id_;
  uint64_t shown_ = 0;
  uint64_t torn_ = 0;
  uint64_t out_of_order_ = 0;
};

void refresh_for(Screen& screen, microseconds duration) {
  const auto end = std::chrono::steady_clock::now() + duration;
  do {
    screen.refresh();
    std::this_thread::sleep_for(microseconds(50));
  } while (std::chrono::steady_clock::now() < end);
}

TEST(RingDeath, APlayerSurvivesKilledRenderers) {
  SocketFolder folder;
  const auto player = RingPlayer::open(busy_ring(folder.socket()));
  Screen screen(*player);
  std::mt19937 random(20240229);
  for (int round = 1; round <= kKillsOfEach; ++round) {
    const Fate fate(round, random);
    const uint64_t enough = screen.shown() + fate.frames;
    Child renderer([&] { render_for_ever(folder.socket(), static_cast<uint64_t>(round) << 32); });
    ASSERT_TRUE(test::service_until(*player,
                                    [&] {
                                      screen.refresh();
                                      return screen.shown() >= enough;
                                    }))
        << "round " << round;
    refresh_for(screen, fate.then);
    renderer.kill_and_reap();
    screen.refresh();
    ASSERT_TRUE(test::service_until(*player,
                                    [&] {
                                      screen.refresh();
                                      const RingStatistics now = test::statistics_of(*player);
                                      return !now.renderer_connected && now.slots_shut == 0;
                                    }))
        << "round " << round;
  }
  EXPECT_EQ(screen.torn(), 0u);
  EXPECT_EQ(screen.out_of_order(), 0u);
  EXPECT_TRUE(screen.holds_whole_frame()) << "the last complete frame stays displayed";
  const RingStatistics figures = test::statistics_of(*player);
  EXPECT_EQ(figures.violations, 0u);
  EXPECT_EQ(figures.renderer_deaths, figures.renderers);
  EXPECT_GE(figures.renderers, kKillsOfEach * 3u / 4u);
  EXPECT_GT(figures.slots_recovered, 4u) << "some kills must fall into the middle of frames";

  const auto next = test::connect_to(*player, folder.socket());
  for (uint64_t k = 0; k < 3; ++k)
    EXPECT_EQ(test::push_frame(*next, k, (1000ull << 32) + k), RingStatus::Ok)
        << "three of four slots are free again, the fourth is displayed";
  screen.refresh();
  EXPECT_EQ(screen.torn(), 0u);
}

/// Figures that a player process reports to the test in shared memory; they survive its death.
struct Report {
  std::atomic<uint64_t> shown;
  std::atomic<uint64_t> torn;
};

class SharedReport {
 public:
  SharedReport()
      : report_(static_cast<Report*>(::mmap(nullptr, sizeof(Report), PROT_READ | PROT_WRITE,
                                            MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {}
  ~SharedReport() { ::munmap(report_, sizeof(Report)); }
  SharedReport(const SharedReport&) = delete;
  SharedReport& operator=(const SharedReport&) = delete;
  Report& operator*() const { return *report_; }

 private:
  Report* report_;
};

void play_for_ever(const std::filesystem::path& socket, Report& report) {
  const auto player = RingPlayer::open(busy_ring(socket));
  Screen screen(*player);
  for (uint64_t shown = 0, torn = 0;;) {
    screen.refresh();
    report.shown += screen.shown() - shown;
    report.torn += screen.torn() + screen.out_of_order() - torn;
    shown = screen.shown();
    torn = screen.torn() + screen.out_of_order();
    std::this_thread::sleep_for(microseconds(50));
  }
}

TEST(RingDeath, ARendererSurvivesKilledPlayers) {
  SocketFolder folder;
  SharedReport report;
  std::mt19937 random(20240301);
  int connections = 0, losses = 0;
  for (int round = 0; round < kKillsOfEach; ++round) {
    Child player([&] { play_for_ever(folder.socket(), *report); });
    const Fate fate(round, random);
    const uint64_t enough = (*report).shown + fate.frames;
    std::thread killer([&] {
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
      while ((*report).shown < enough && std::chrono::steady_clock::now() < deadline)
        std::this_thread::sleep_for(microseconds(50));
      std::this_thread::sleep_for(fate.then);
      player.send(SIGKILL);
    });
    RingStatus status = RingStatus::Ok;
    try {
      const auto renderer = RingRenderer::connect(
          folder.socket(), {}, fate.any_moment ? milliseconds(30) : milliseconds(20000));
      ++connections;
      for (uint64_t k = 0; status == RingStatus::Ok; ++k)
        status = test::push_frame(*renderer, k, k, std::chrono::seconds(20));
      EXPECT_EQ(status, RingStatus::Gone);
      ++losses;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Device) << "it died before it answered: " << error.what();
    }
    killer.join();
    player.kill_and_reap();
  }
  EXPECT_EQ(connections, losses);
  EXPECT_GE(connections, kKillsOfEach * 3 / 4);
  EXPECT_EQ((*report).torn, 0u);
  EXPECT_GE((*report).shown, kKillsOfEach * 3u / 4u);

  const auto last = RingPlayer::open(busy_ring(folder.socket()));
  const auto renderer = test::connect_to(*last, folder.socket());
  ASSERT_EQ(test::push_frame(*renderer, 0, 77), RingStatus::Ok);
  EXPECT_EQ(test::pull_all(*last), std::vector{std::optional<uint64_t>(77)});
}

TEST(RingDeath, AStoppedRendererDoesNotBlockThePlayer) {
  SocketFolder folder;
  const auto player = RingPlayer::open(busy_ring(folder.socket()));
  Screen screen(*player);
  Child renderer([&] { render_for_ever(folder.socket(), 0); });
  ASSERT_TRUE(test::service_until(*player, [&] {
    screen.refresh();
    return screen.shown() > 20;
  }));
  renderer.stop();
  for (int i = 0; i < 1000; ++i) screen.refresh();  // each returns at once, or the test times out
  const uint64_t shown = screen.shown();
  EXPECT_TRUE(screen.holds_whole_frame());
  EXPECT_THROW((void)test::connect_to(*player, folder.socket(), {}, milliseconds(30)), Error)
      << "it is still connected";
  EXPECT_EQ(screen.shown(), shown);

  renderer.send(SIGCONT);
  EXPECT_TRUE(test::service_until(*player, [&] {
    screen.refresh();
    return screen.shown() > shown + 20;
  })) << "it goes on where it was";

  renderer.stop();
  renderer.kill_and_reap();
  EXPECT_TRUE(test::service_until(*player, [&] {
    screen.refresh();
    return !test::statistics_of(*player).renderer_connected &&
           test::statistics_of(*player).slots_shut == 0;
  }));
  EXPECT_EQ(screen.torn(), 0u);
  EXPECT_EQ(test::statistics_of(*player).violations, 0u);
}

TEST(RingDeath, ADisconnectedRendererCannotDamageTheNextOnesFrames) {
  SocketFolder folder;
  const auto player = RingPlayer::open(busy_ring(folder.socket()));
  Screen screen(*player);
  // The renderer takes a slot, loses its socket, and continues to write into the slot.
  Child zombie([&] {
    test::RawRenderer renderer(folder.socket());
    if (!take_free_slot(renderer.table()[1], renderer.epoch())) return;
    renderer.hang_up();
    for (uint64_t k = 0;; ++k) test::stamp_frame(renderer.pixels(1), ~k);
  });
  ASSERT_TRUE(
      test::service_until(*player, [&] { return test::statistics_of(*player).slots_shut == 1; }));

  const auto next = test::connect_to(*player, folder.socket());
  for (uint64_t k = 0; k < 200; ++k) {
    ASSERT_EQ(test::push_frame(*next, k, k), RingStatus::Ok);
    screen.refresh();
  }
  EXPECT_EQ(screen.torn(), 0u);
  EXPECT_EQ(screen.shown(), 200u);
  EXPECT_EQ(test::statistics_of(*player).slots_shut, 1);

  zombie.kill_and_reap();
  EXPECT_TRUE(test::service_until(*player, [&] {
    return test::statistics_of(*player).slots_shut == 0;
  })) << "its death gives the slot back";
  EXPECT_EQ(test::statistics_of(*player).slots_recovered, 1u);
}

}  // namespace
}  // namespace lenticule::frames
