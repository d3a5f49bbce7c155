// SPDX-License-Identifier: Apache-2.0
// StepLink connects a player to its group: it exchanges messages on a thread of its own, and gives
// the timeline to the player's StepPacing.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_fd.h"
#include "frames/ring/listen_socket.h"
#include "player/step/step_member.h"
#include "player/step/step_message.h"
#include "player/step/step_pacing.h"

namespace lenticule::player {

/// The address of a socket.
struct StepEndpoint {
  sockaddr_storage address{};
  socklen_t bytes = 0;
};

/// The address of a group's leader, from --step-address.
struct StepAddress {
  std::string text;
  bool is_unix = false;
  StepEndpoint endpoint;
};
/// Parses "ADDRESS:PORT", "[ADDRESS]:PORT", or the path of a Unix socket, which has a slash. Throws
/// Error(Usage).
[[nodiscard]] StepAddress parse_step_address(const std::string& text);

/// StepSocket carries datagrams between the players of a group: UDP between machines, or a Unix
/// socket between players of one user on one machine.
/// Thread safety: one thread.
class StepSocket {
 public:
  /// Binds the address as the leader, or any free address as a follower. Throws Error(Device) if
  /// the address is in use or not this machine's, Error(Failed) otherwise.
  StepSocket(const StepAddress& address, bool leader);

  [[nodiscard]] int fd() const noexcept { return fd_; }

  struct Datagram {
    std::span<const uint8_t> bytes;  ///< valid until the next call
    StepEndpoint from;
  };
  /// Returns the next waiting datagram. Datagrams of other users on a Unix socket are left out.
  [[nodiscard]] std::optional<Datagram> receive() noexcept;
  /// Sends without waiting; a datagram that cannot be sent is lost.
  void send(const StepEndpoint& to, std::span<const uint8_t> bytes) const noexcept;

 private:
  /// One byte more than a message, so that a longer datagram is noticed.
  std::array<uint8_t, kStepMessageBytes + 1> buffer_{};
  std::optional<frames::ListenSocket> listening_;  ///< the leader's Unix socket
  UniqueFd own_;
  int fd_ = -1;
  bool is_unix_ = false;
};

/// The flags of `lenticule play` that begin with --step, checked.
struct StepOptions {
  std::string group;
  bool leader = false;
  StepAddress address;
  std::vector<uint8_t> key;
};

/// Returns the bytes of a key file. Throws Error(Input) if it has less than 32 bytes, or if other
/// users can read it.
[[nodiscard]] std::vector<uint8_t> read_step_key(const std::string& file);

class StepLink {
 public:
  /// Opens the socket and begins to listen. Throws as StepSocket does.
  explicit StepLink(const StepOptions& options);
  ~StepLink();
  StepLink(const StepLink&) = delete;
  StepLink& operator=(const StepLink&) = delete;

  /// Returns the pacing that the presenter asks.
  [[nodiscard]] StepPacing& pacing() noexcept { return pacing_; }
  /// Returns the figures for the statistics. Thread safety: any thread.
  [[nodiscard]] nlohmann::ordered_json statistics() const;
  /// Prints what hinders the group, once per change. Thread safety: one thread.
  void report_problem();

 private:
  /// Status holds the figures of the thread that the statistics print.
  struct Status {
    StepMessageCounts counts;
    uint64_t sent = 0;
    size_t peers = 0;
    int64_t apart = 0;
    int64_t largest_apart = 0;
    uint64_t clock_steps = 0;
    std::chrono::nanoseconds ahead_of_monotonic{0};
    ClockAccuracy accuracy;
    std::string problem;
    std::string remedy;
  };

  void run() noexcept;
  void receive_waiting(const StepNow& now);
  void tick(const StepNow& now);
  void update_status(const StepPlace& place, const StepNow& now);
  void find_problem(const StepPlace& place, const StepNow& now, Status& status) const;
  [[nodiscard]] Status status() const;

  const StepOptions options_;
  StepSocket socket_;
  StepPacing pacing_;
  StepClock clock_;
  std::unique_ptr<StepMember> member_;
  StepLeader* leader_ = nullptr;                ///< member_, if it is the leader
  std::map<uint64_t, StepEndpoint> endpoints_;  ///< address of each follower, by session
  std::chrono::nanoseconds untimely_until_{0};  ///< end of the time in which that is reported

  mutable std::mutex mutex_;  ///< guards status_
  Status status_;
  std::string reported_;  ///< remedy of the problem that was printed last

  WakeFd wake_{"step"};
  std::atomic<bool> stopping_{false};
  std::thread thread_;  ///< last member: ends before the others are destroyed
};

}  // namespace lenticule::player
