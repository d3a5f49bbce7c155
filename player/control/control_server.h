// SPDX-License-Identifier: Apache-2.0
// ControlServer listens on a player's control socket on its own thread, so that slow or broken
// clients cannot delay the playback threads.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "base/unique_fd.h"
#include "frames/ring/listen_socket.h"
#include "player/control/control_protocol.h"

namespace lenticule::player {

/// ControlPeer identifies the process at the other end of a Unix socket; ControlPolicy decides
/// whether that process may control a player.
struct ControlPeer {
  uid_t uid = static_cast<uid_t>(-1);
  std::vector<gid_t> groups{};
};

struct ControlPolicy {
  uid_t owner = 0;
  std::optional<gid_t> group{};
};

enum class ControlRights {
  None,
  Steer,  ///< everything except writing files that the peer names
  Everything,
};

/// Returns the rights of `peer`: the owner and root have every right, members of the group may
/// steer.
[[nodiscard]] ControlRights rights_of(const ControlPeer& peer, const ControlPolicy& policy);

/// Returns the peer's credentials as reported by the kernel; none if the kernel does not report
/// them.
[[nodiscard]] std::optional<ControlPeer> peer_of(int socket);

/// Returns the group's id. Throws Error(Usage) if there is no group of that name.
[[nodiscard]] gid_t group_named(const std::string& name);

/// An answer with which a descriptor is sent.
struct DescriptorAnswer {
  nlohmann::ordered_json body;
  std::shared_ptr<const UniqueFd> descriptor;
};

/// An error because the request does not fit what the player is doing at the moment.
struct ConflictAnswer {
  Error error;
};

/// The result of a verb: the answer's own keys, or the error.
using ControlAnswer = std::variant<nlohmann::ordered_json, DescriptorAnswer, ConflictAnswer, Error>;

/// ControlTarget carries out the verbs; the player implements it.
class ControlTarget {
 public:
  virtual ~ControlTarget() = default;
  /// Handles a request on the server's thread; must not block. `answer` is called once, on any
  /// thread, immediately or later. A thrown Error becomes the answer. Subscribe is handled by the
  /// server and never passed on.
  virtual void handle(const ControlRequest& request, ControlRights rights,
                      std::function<void(ControlAnswer)> answer) = 0;
};

struct ControlLimits {
  size_t clients = 16;
  size_t unanswered = 8;  ///< unanswered requests of one client at which reading from it pauses
  /// Pending output of one client at which reading from it pauses.
  size_t waiting_bytes = 64u << 10;
  size_t dropped_bytes = 256u << 10;  ///< pending output of one client at which it is dropped
  /// Time without accepting output after which a client is dropped.
  std::chrono::milliseconds stuck = std::chrono::seconds(10);
  /// A client that has not sent a request for this long may be disconnected to admit another.
  std::chrono::milliseconds idle = std::chrono::seconds(2);
  /// Time after which a request that the target has not answered gets an error; longer for verbs
  /// that open or write content.
  std::chrono::milliseconds answer = std::chrono::seconds(8);
  std::chrono::milliseconds opening = std::chrono::seconds(55);
  int events_per_second = 50;  ///< limit per client; further events are counted and left out
};

struct ControlServerOptions {
  std::string socket = {};
  std::optional<gid_t> group{};
  ControlLimits limits{};
  /// Identifies the process at the other end of a connection; the kernel's answer unless a test
  /// replaces it.
  std::function<std::optional<ControlPeer>(int)> peer = peer_of;
};

struct ControlCounts {
  uint64_t accepted = 0;
  uint64_t refused = 0;    ///< connections without permission or beyond the limit
  uint64_t dropped = 0;    ///< clients with a line too long or output not taken
  uint64_t displaced = 0;  ///< clients disconnected to admit others
};

class ControlServer {
 public:
  /// Throws as frames::ListenSocket does. Lifetime: `target` must outlive the server.
  ControlServer(ControlServerOptions options, ControlTarget& target);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  /// Sends the event to every subscriber. Thread safety: any thread; never waits for a client.
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
    /// Descriptors to send, each with the number of bytes of `out` that come before its line.
    struct Passed {
      size_t at = 0;
      std::shared_ptr<const UniqueFd> descriptor;
    };
    std::deque<Passed> passed{};
    /// A request that is passed on and not answered yet.
    struct Asked {
      nlohmann::json id;
      ControlVerb verb = ControlVerb::Status;
      Clock::time_point at{};
    };
    std::map<uint64_t, Asked> unanswered{};  ///< the key is the number of the request
    bool subscribed = false;
    bool sent_all = false;  ///< the client has shut down its sending side and may still read
    bool closing = false;   ///< closes once `out` is sent
    bool dead = false;
    double event_tokens = 0.0;
    uint64_t events_left_out = 0;
    Clock::time_point tokens_at{};
    Clock::time_point took_at{};
    Clock::time_point asked_at{};  ///< time of its last complete request, or of its connection
  };
  /// Messages from other threads. Shared, because an answer may arrive after the server is
  /// destroyed.
  struct Inbox {
    struct Line {
      uint64_t client = 0;
      uint64_t request = 0;
      std::string text;
      std::shared_ptr<const UniqueFd> descriptor{};
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
  void queue(Client& client, const std::string& line,
             const std::shared_ptr<const UniqueFd>& descriptor = nullptr);
  [[nodiscard]] static ssize_t send_some(Client& client);
  void flush(Client& client);
  void give_up_late(Client& client);
  void drop_stuck(Client& client);

  const ControlServerOptions options_;
  const ControlPolicy policy_;
  ControlTarget& target_;
  frames::ListenSocket socket_;
  std::shared_ptr<Inbox> inbox_;
  std::vector<std::unique_ptr<Client>> clients_;
  uint64_t next_client_ = 1;
  uint64_t next_request_ = 1;
  Clock::time_point accepts_again_{};
  std::atomic<uint64_t> accepted_{0};
  std::atomic<uint64_t> refused_{0};
  std::atomic<uint64_t> dropped_{0};
  std::atomic<uint64_t> displaced_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
