// SPDX-License-Identifier: Apache-2.0
// Listens on a player's control socket, on a thread of its own: nothing that a client does or
// leaves undone is felt by the threads that play.
#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "base/wake_fd.h"
#include "frames/ring/listen_socket.h"
#include "player/control/control_peer.h"
#include "player/control/control_protocol.h"

namespace lenticule::player {

/// What a verb came to: the answer's own keys, or why not.
using ControlAnswer = std::variant<nlohmann::ordered_json, Error>;

/// The player behind the verbs.
class ControlTarget {
 public:
  virtual ~ControlTarget() = default;
  /// On the server's thread; must not wait. `answer` is called once, on any thread, at once or
  /// later. Throws Error, as an answer. Subscribe never comes here.
  virtual void handle(const ControlRequest& request, ControlRights rights,
                      std::function<void(ControlAnswer)> answer) = 0;
};

struct ControlLimits {
  size_t clients = 16;
  size_t unanswered = 8;              ///< requests of one client; more are not read meanwhile
  size_t waiting_bytes = 64u << 10;   ///< of output, above which nothing more is read of a client
  size_t dropped_bytes = 256u << 10;  ///< of output, above which it is dropped
  std::chrono::milliseconds stuck = std::chrono::seconds(10);  ///< that take nothing are dropped
  /// Without a request for so long, a client may have to make room for somebody else's.
  std::chrono::milliseconds idle = std::chrono::seconds(2);
  int events_per_second = 50;  ///< to one client; more are counted and left out
};

struct ControlServerOptions {
  std::string socket = {};
  std::optional<gid_t> group{};
  ControlLimits limits{};
  /// Who is at the other end: the kernel's word, unless a test has another.
  std::function<std::optional<ControlPeer>(int)> peer = peer_of;
};

struct ControlCounts {
  uint64_t accepted = 0;
  uint64_t refused = 0;    ///< strangers, and those too many
  uint64_t dropped = 0;    ///< for lines too long or output not taken
  uint64_t displaced = 0;  ///< to make room for others
};

class ControlServer {
 public:
  /// Throws as frames::ListenSocket does. `target` must outlive it.
  ControlServer(ControlServerOptions options, ControlTarget& target);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  /// To everybody who subscribed. Any thread; never waits for a client.
  void publish(nlohmann::ordered_json event);
  [[nodiscard]] ControlCounts counts() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Client {
    UniqueFd fd;
    uint64_t number = 0;
    ControlRights rights = ControlRights::None;
    std::string in{};
    std::string out{};
    size_t unanswered = 0;
    bool subscribed = false;
    bool sent_all = false;  ///< it says nothing more, and may still listen
    bool closing = false;   ///< when `out` is gone
    bool dead = false;
    double event_tokens = 0.0;
    uint64_t events_left_out = 0;
    Clock::time_point tokens_at{};
    Clock::time_point took_at{};
    Clock::time_point asked_at{};  ///< its last whole request, or when it came
  };
  /// What comes from other threads. Answers may come when the server is gone.
  struct Inbox {
    struct Line {
      uint64_t client = 0;
      std::string text;
    };
    std::mutex mutex;
    std::vector<Line> answers;
    std::deque<nlohmann::ordered_json> events;
    uint64_t events_left_out = 0;
    WakeFd wake;
  };

  void serve() noexcept;
  void serve_once();
  [[nodiscard]] bool reads(const Client& client) const;
  void accept_all();
  void admit(UniqueFd fd);
  [[nodiscard]] bool make_room(ControlRights newcomer);
  void receive(Client& client);
  void take_lines(Client& client);
  void take_line(Client& client, const std::string& line);
  void take_inbox();
  void send_event(Client& client, const nlohmann::ordered_json& event);
  void queue(Client& client, const std::string& line);
  void flush(Client& client);
  void drop_stuck(Client& client);

  const ControlServerOptions options_;
  const ControlPolicy policy_;
  ControlTarget& target_;
  frames::ListenSocket socket_;
  std::shared_ptr<Inbox> inbox_;
  std::vector<std::unique_ptr<Client>> clients_;
  uint64_t next_client_ = 1;
  Clock::time_point accepts_again_{};
  std::atomic<uint64_t> accepted_{0};
  std::atomic<uint64_t> refused_{0};
  std::atomic<uint64_t> dropped_{0};
  std::atomic<uint64_t> displaced_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;  // last: it uses everything above
};

}  // namespace lenticule::player
