// SPDX-License-Identifier: Apache-2.0
// Tests players in step as processes on one machine: `lenticule play --step`.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <map>

#include "base/unique_fd.h"
#include "tests/commands/player_stage.h"

namespace lenticule::test {
namespace {

constexpr double kVblank = 0.05;  // 20 Hz: a busy machine keeps up
constexpr int kLoop = 24;

sockaddr_in loopback(uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

UniqueFd udp_socket() {
  UniqueFd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const sockaddr_in any = loopback(0);
  EXPECT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&any), sizeof any), 0);
  return fd;
}

uint16_t port_of(const UniqueFd& fd) {
  sockaddr_in address{};
  socklen_t bytes = sizeof address;
  EXPECT_EQ(::getsockname(fd.get(), reinterpret_cast<sockaddr*>(&address), &bytes), 0);
  return ntohs(address.sin_port);
}

/// Passes datagrams between followers and a leader: loses every fifth, repeats every seventh and
/// damages every eleventh.
class Relay {
 public:
  explicit Relay(uint16_t leader_port)
      : leader_(loopback(leader_port)), front_(udp_socket()), thread_([this] { run(); }) {}
  ~Relay() {
    stopping_ = true;
    thread_.join();
  }
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  [[nodiscard]] uint16_t port() const { return port_of(front_); }

 private:
  struct Follower {
    sockaddr_in address{};
    UniqueFd back;
  };

  void run() {
    while (!stopping_) {
      std::vector<pollfd> entries = {{.fd = front_.get(), .events = POLLIN, .revents = 0}};
      for (const auto& [port, follower] : followers_)
        entries.push_back({.fd = follower.back.get(), .events = POLLIN, .revents = 0});
      (void)::poll(entries.data(), entries.size(), 50);
      pass_on(front_.get(), nullptr);
      for (const auto& [port, follower] : followers_)
        pass_on(follower.back.get(), &follower.address);
    }
  }

  /// Passes on waiting datagrams to `to`, or to the leader in the name of their sender.
  void pass_on(int from, const sockaddr_in* to) {
    std::array<uint8_t, 2048> bytes{};
    sockaddr_in sender{};
    socklen_t length = sizeof sender;
    const auto next = [&] {
      length = sizeof sender;
      return ::recvfrom(from, bytes.data(), bytes.size(), MSG_DONTWAIT,
                        reinterpret_cast<sockaddr*>(&sender), &length);
    };
    for (ssize_t got = next(); got >= 0; got = next()) {
      int out = front_.get();
      if (to == nullptr) {
        Follower& follower = followers_[sender.sin_port];
        if (!follower.back) follower = {.address = sender, .back = udp_socket()};
        out = follower.back.get();
      }
      send(out, to == nullptr ? leader_ : *to, std::span(bytes).first(static_cast<size_t>(got)));
    }
  }

  void send(int from, const sockaddr_in& to, std::span<uint8_t> bytes) {
    const int number = ++count_;
    if (number % 5 == 0) return;
    if (number % 11 == 0) bytes[20] ^= 1;
    for (int copies = number % 7 == 0 ? 2 : 1; copies > 0; --copies)
      (void)::sendto(from, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                     sizeof to);
  }

  sockaddr_in leader_;
  UniqueFd front_;
  std::map<uint16_t, Follower> followers_;
  int count_ = 0;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

class Step : public PlayerTest {
 protected:
  void SetUp() override {
    PlayerTest::SetUp();
    std::filesystem::create_directories(path("film"));
    for (int k = 0; k < kLoop; ++k)
      write_picture(fmt_name("film/", k), static_cast<uint8_t>(10 * k));
    write("step.key", std::string(32, 'k'));
    std::filesystem::permissions(path("step.key"), std::filesystem::perms::owner_read);
  }

  static std::string fmt_name(const std::string& folder, int number) {
    return folder + (number < 10 ? "0" : "") + std::to_string(number) + ".png";
  }
  [[nodiscard]] std::vector<std::string> words(const std::string& name,
                                               const std::vector<std::string>& step) const {
    const std::vector<std::string> all = joined(
        {"play", path("film/%02d.png"), "--rig", path("rig.toml"), "--display", "virtual:48x32@20",
         "--fps", "20", "--loop", "forever", "--stats", path(name + ".json"), "--step", "wall"},
        step);
    return all;
  }
  void start_player(const std::string& name, const char* role, const std::string& address,
                    bool with_key = true) {
    std::vector<std::string> step = {role, "--step-address", address};
    if (with_key) step.insert(step.end(), {"--step-key", path("step.key")});
    std::filesystem::remove(path(name + ".json"));
    players_[name] = std::make_unique<BackgroundProcess>(program(words(name, step)));
  }
  void kill_player(const std::string& name) {
    players_[name]->signal(SIGKILL);
    (void)players_[name]->wait(kPlayerTimeout);
    players_.erase(name);
  }
  /// Returns the object `step` of a player's statistics.
  [[nodiscard]] json step_of(const std::string& name) const {
    std::ifstream file(path(name + ".json"));
    const json statistics = json::parse(file, nullptr, false);
    return statistics.is_object() ? statistics.value("step", json::object()) : json::object();
  }
  [[nodiscard]] bool all_are(const std::string& state) const {
    for (const auto& [name, player] : players_)
      if (step_of(name).value("state", "") != state) return false;
    return true;
  }
  /// PhaseSamples collects when the first frame of the loop appears on a player's panel, in seconds
  /// below a loop.
  class PhaseSamples {
   public:
    /// Adds a player's last displayed frame, if it is another one than before.
    void add(const json& shown) {
      const uint64_t time = shown.value("time_ns", uint64_t{0});
      if (time == std::exchange(last_, time)) return;
      const double phase = static_cast<double>(time % 1'000'000'000'000) * 1e-9 -
                           shown.value("frame", 0.0) * kVblank;
      const double first = phases_.empty() ? phase : phases_.front();
      phases_.push_back(first + std::remainder(phase - first, kLoop * kVblank));
    }
    [[nodiscard]] bool enough() const { return phases_.size() >= 5; }
    /// Returns the median, because a busy machine may show single frames late.
    [[nodiscard]] double median() const {
      std::vector<double> sorted = phases_;
      std::sort(sorted.begin(), sorted.end());
      return sorted[sorted.size() / 2];
    }

   private:
    uint64_t last_ = 0;
    std::vector<double> phases_;
  };

  /// Expects that each frame appears on all panels within a vblank and a tolerance of 0.15.
  void expect_same_frames() const {
    std::map<std::string, PhaseSamples> samples;
    ASSERT_TRUE(comes_true([&] {
      bool enough = true;
      for (const auto& [name, player] : players_) {
        samples[name].add(step_of(name).value("shown", json::object()));
        enough = enough && samples[name].enough();
      }
      return enough;
    }));
    const double reference = samples.begin()->second.median();
    for (const auto& [name, phases] : samples) {
      const double apart = std::remainder(phases.median() - reference, kLoop * kVblank);
      EXPECT_LE(std::abs(apart), 1.15 * kVblank) << name << " and " << samples.begin()->first;
    }
  }

  std::map<std::string, std::unique_ptr<BackgroundProcess>> players_;
};

TEST_F(Step, ThreePlayersShowTheSameFrameAlthoughMessagesAreLostAndTheLeaderIsKilled) {
  const uint16_t port = port_of(udp_socket());
  Relay relay(port);
  const std::string leader = "127.0.0.1:" + std::to_string(port);
  const std::string relayed = "127.0.0.1:" + std::to_string(relay.port());
  start_player("leader", "--leader", leader);
  start_player("left", "--follow", relayed);
  start_player("right", "--follow", relayed);
  ASSERT_TRUE(comes_true([&] { return all_are("in step"); }));
  EXPECT_TRUE(comes_true([&] { return step_of("leader").value("peers", 0) == 2; }));
  expect_same_frames();

  kill_player("leader");
  ASSERT_TRUE(comes_true([&] { return all_are("alone"); }));
  expect_same_frames();

  start_player("leader", "--leader", leader);
  ASSERT_TRUE(comes_true([&] { return all_are("in step"); }));
  expect_same_frames();
  for (const char* name : {"left", "right"}) {
    const json step = step_of(name);
    EXPECT_EQ(step.value("joined", 0), 1) << step.dump();
    EXPECT_GT(step["messages"].value("refused_replayed", 0), 0) << step.dump();
    EXPECT_GT(step["messages"].value("refused_key", 0), 0) << step.dump();
  }
}

TEST_F(Step, PlayersOfOneMachineNeedOnlyAUnixSocket) {
  start_player("follower", "--follow", path("step.sock"), false);
  start_player("leader", "--leader", path("step.sock"), false);
  ASSERT_TRUE(comes_true([&] { return all_are("in step"); }));
  expect_same_frames();
  EXPECT_EQ(step_of("follower").value("problem", "?"), "");
  expect_end(run(words("second", {"--leader", "--step-address", path("step.sock")})), 3,
             "already in use");
}

TEST_F(Step, AFilmOfAnotherLengthIsNamed) {
  start_player("leader", "--leader", path("step.sock"), false);
  std::vector<std::string> shorter =
      words("shorter", {"--follow", "--step-address", path("step.sock"), "--frames", "0:20"});
  players_["shorter"] = std::make_unique<BackgroundProcess>(program(shorter));
  EXPECT_TRUE(comes_true([&] {
    return step_of("shorter").value("problem", "") ==
           "this film has 20 frames, that of the group has 24";
  }));
}

TEST_F(Step, WrongFlagsAreRefusedWithTheRemedy) {
  const std::string key = path("step.key");
  write("short.key", "1234");
  write("list.toml", "[[item]]\nsource = \"film/%02d.png\"\n");
  const auto expect = [&](const std::vector<std::string>& step, int code, const std::string& text) {
    expect_end(run(words("none", step)), code, text);
  };
  expect({"--step-address", "127.0.0.1:7070"}, 2, "--step: needs either --leader or --follow");
  expect({"--leader", "--follow", "--step-address", "127.0.0.1:7070"}, 2, "needs either");
  expect({"--leader"}, 2, "--step-address: missing");
  expect({"--leader", "--step-address", "127.0.0.1:7070"}, 2, "--step-key: missing");
  expect({"--leader", "--step-address", "lobby:7070", "--step-key", key}, 2, "not an address");
  expect({"--leader", "--step-address", "127.0.0.1:0", "--step-key", key}, 2, "not an address");
  expect({"--leader", "--step-address", "192.0.2.1:7070", "--step-key", key}, 3, "cannot be bound");
  expect({"--leader", "--step-address", "127.0.0.1:7070", "--step-key", path("short.key")}, 4,
         "has 4 bytes");
  std::filesystem::permissions(key, std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  expect({"--leader", "--step-address", "127.0.0.1:7070", "--step-key", key}, 4,
         "other users of this machine may use the key");
  expect({"--leader", "--step-address", "./s", "--late", "hold"}, 2, "--late hold");
  expect({"--leader", "--step-address", "./s", "--clock", "simulated"}, 2, "--clock simulated");
  expect_end(run({"play", path("list.toml"), "--rig", path("rig.toml"), "--step", "wall",
                  "--leader", "--step-address", "./s"}),
             2, "is a list");
  expect_end(run({"play", path("film/%02d.png"), "--rig", path("rig.toml"), "--leader",
                  "--step-address", "./s"}),
             2, "add --step GROUP");
}

}  // namespace
}  // namespace lenticule::test
