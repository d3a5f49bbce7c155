// SPDX-License-Identifier: Apache-2.0
// StepLink connects a player to its group: it exchanges messages on a thread of its own, and gives
// the timeline to the player's StepPacing.
#pragma once

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/unique_fd.h"
#include "base/unix_address.h"
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
inline StepEndpoint endpoint_of(const sockaddr* address, socklen_t bytes) {
  StepEndpoint endpoint{.bytes = bytes};
  std::memcpy(&endpoint.address, address, bytes);
  return endpoint;
}

[[noreturn]] inline void refuse_address(const std::string& text) {
  throw usage_error("--step-address '{}': not an address", text)
      .remedy(
          "write ADDRESS:PORT with a numeric address, such as 192.168.1.20:7070 or "
          "[fd00::20]:7070, or the path of a Unix socket, such as /run/lenticule/step.sock");
}

/// Parses "ADDRESS:PORT", "[ADDRESS]:PORT", or the path of a Unix socket, which has a slash. Throws
/// Error(Usage).
[[nodiscard]] inline StepAddress parse_step_address(const std::string& text) {
  if (text.find('/') != std::string::npos) {
    const UnixAddress address = unix_address(text);
    return {.text = text, .is_unix = true, .endpoint = endpoint_of(address.get(), address.bytes)};
  }
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) refuse_address(text);
  std::string host = text.substr(0, colon);
  const std::string port = text.substr(colon + 1);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']')
    host = host.substr(1, host.size() - 2);
  else if (host.find(':') != std::string::npos)
    refuse_address(text);
  const auto number = number_from<uint16_t>(port);
  if (!number || *number == 0) refuse_address(text);
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) refuse_address(text);
  StepAddress address{.text = text, .endpoint = endpoint_of(found->ai_addr, found->ai_addrlen)};
  ::freeaddrinfo(found);
  return address;
}

/// StepSocket carries datagrams between the players of a group: UDP between machines, or a Unix
/// socket between players of one user on one machine.
/// Thread safety: one thread.
class StepSocket {
 public:
  /// Binds the address as the leader, or any free address as a follower. Throws Error(Device) if
  /// the address is in use or not this machine's, Error(Failed) otherwise.
  StepSocket(const StepAddress& address, bool leader) : is_unix_(address.is_unix) {
    if (is_unix_ && leader) {
      fd_ = listening_.emplace(address.text, frames::ListenOptions{.type = SOCK_DGRAM}).fd();
    } else {
      constexpr int kType = SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK;
      own_ = UniqueFd(::socket(address.endpoint.address.ss_family, kType, 0));
      check(static_cast<bool>(own_), "no socket");
      fd_ = own_.get();
      if (leader) bind_to(address.endpoint, address.text);
      // The kernel chooses the address of a follower's Unix socket.
      const sockaddr any{.sa_family = AF_UNIX, .sa_data = {}};
      if (is_unix_) check(::bind(fd_, &any, sizeof any.sa_family) == 0, "the socket gets no name");
    }
    const int on = 1;
    if (is_unix_)
      check(::setsockopt(fd_, SOL_SOCKET, SO_PASSCRED, &on, sizeof on) == 0,
            "the kernel names no senders");
  }

  [[nodiscard]] int fd() const noexcept { return fd_; }

  struct Datagram {
    std::span<const uint8_t> bytes;  ///< valid until the next call
    StepEndpoint from;
  };
  /// Returns the next waiting datagram. Datagrams of other users on a Unix socket are left out.
  [[nodiscard]] std::optional<Datagram> receive() noexcept {
    while (true) {
      Datagram datagram;
      iovec part{.iov_base = buffer_.data(), .iov_len = buffer_.size()};
      alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(ucred))> control{};
      msghdr header{};
      header.msg_name = &datagram.from.address;
      header.msg_namelen = sizeof datagram.from.address;
      header.msg_iov = &part;
      header.msg_iovlen = 1;
      header.msg_control = control.data();
      header.msg_controllen = control.size();
      const ssize_t bytes = ::recvmsg(fd_, &header, MSG_DONTWAIT);
      // A follower whose leader is gone gets the error of its last datagram here.
      if (bytes < 0 && (errno == EINTR || errno == ECONNREFUSED)) continue;
      if (bytes < 0) return std::nullopt;
      if (is_unix_ && !sent_by_us(header)) continue;
      datagram.from.bytes = header.msg_namelen;
      datagram.bytes = std::span(buffer_).first(static_cast<size_t>(bytes));
      return datagram;
    }
  }
  /// Sends without waiting; a datagram that cannot be sent is lost.
  void send(const StepEndpoint& to, std::span<const uint8_t> bytes) const noexcept {
    (void)::sendto(fd_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, generic(to),
                   to.bytes);
  }

 private:
  static const sockaddr* generic(const StepEndpoint& endpoint) {
    return reinterpret_cast<const sockaddr*>(&endpoint.address);
  }

  static void check(bool done, const char* problem) {
    if (done) return;
    throw failed_error("--step: {}: {}", problem, std::strerror(errno));
  }

  void bind_to(const StepEndpoint& endpoint, const std::string& text) const {
    if (::bind(fd_, generic(endpoint), endpoint.bytes) == 0) return;
    const bool taken = errno == EADDRINUSE;
    throw device_error("--step-address {}: cannot be bound: {}", text, std::strerror(errno))
        .remedy(taken ? "stop the other leader, or use another port"
                      : "a leader needs an address of its own machine, or 0.0.0.0 for all of them");
  }

  /// Returns true if the kernel states that this user or root sent the datagram.
  static bool sent_by_us(const msghdr& header) {
    for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr;
         part = CMSG_NXTHDR(const_cast<msghdr*>(&header), part)) {
      if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_CREDENTIALS) continue;
      ucred sender{};
      std::memcpy(&sender, CMSG_DATA(part), sizeof sender);
      return sender.uid == ::geteuid() || sender.uid == 0;
    }
    return false;
  }
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

inline constexpr size_t kLeastKeyBytes = 32;
inline constexpr uint64_t kMostKeyBytes = 4096;

/// Returns the bytes of a key file. Throws Error(Input) if it has less than 32 bytes, or if other
/// users can read it.
[[nodiscard]] inline std::vector<uint8_t> read_step_key(const std::string& file) {
  std::vector<uint8_t> key = read_whole_file(file, kMostKeyBytes);
  if (key.size() < kLeastKeyBytes)
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: has {} bytes; a key needs {} or more", file, key.size(), kLeastKeyBytes),
        "make one: head -c 32 /dev/urandom > step.key");
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0 && (status.st_mode & S_IRWXO) != 0)
    throw input_error("{}: other users of this machine may use the key", file)
        .remedy("chmod o= " + file);
  return key;
}

class StepLink {
 public:
  /// Opens the socket and begins to listen. Throws as StepSocket does.
  explicit StepLink(const StepOptions& options)
      : options_(options), socket_(options.address, options.leader), clock_(read_clocks()) {
    const StepIdentity identity{
        .group = options.group, .key = StepKey(options.key), .session = random_session()};
    if (options.leader) {
      auto leader = std::make_unique<StepLeader>(identity, clock_.now(read_clocks()));
      leader_ = leader.get();
      member_ = std::move(leader);
    } else {
      member_ = std::make_unique<StepFollower>(identity);
    }
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~StepLink() {
    thread_.request_stop();
    wake_.signal();
  }

  /// Returns the pacing that the presenter asks.
  [[nodiscard]] StepPacing& pacing() noexcept { return pacing_; }
  /// Returns the figures for the statistics. Thread safety: any thread.
  [[nodiscard]] nlohmann::ordered_json statistics() const {
    const Status now = status();
    const StepPlace place = pacing_.place();
    nlohmann::ordered_json json = {
        {"group", options_.group},
        {"role", options_.leader ? "leader" : "follower"},
        {"state", state_of(place, now.peers)},
        {"peers", now.peers},
        {"difference_vblanks", static_cast<double>(place.difference) / kMillion},
        {"largest_difference_vblanks", static_cast<double>(place.largest_difference) / kMillion},
        {"repeated", place.repeated},
        {"dropped", place.dropped},
        {"joined", place.joined},
        {"drift_ppm", static_cast<double>(place.drift_ppb) / 1000.0}};
    if (options_.leader) {
      json["apart_vblanks"] = static_cast<double>(now.apart) / kMillion;
      json["largest_apart_vblanks"] = static_cast<double>(now.largest_apart) / kMillion;
    }
    if (place.shown_ns != 0)
      json["shown"] = {{"frame", place.shown_frame},
                       {"time_ns", place.shown_ns + now.ahead_of_monotonic.count()}};
    json["messages"] = json_of(now.counts, now.sent);
    json["clock"] = json_of(now.accuracy, now.clock_steps);
    json["problem"] = now.problem;
    return json;
  }
  /// Prints what hinders the group, once per change. Thread safety: one thread.
  void report_problem() {
    const Status now = status();
    // The figures in a text change all the time; a kind of problem is reported once.
    if (std::exchange(reported_, now.remedy) == now.remedy) return;
    if (now.problem.empty())
      say("step: the group can be followed again\n");
    else
      say("step: {}; {}\n", now.problem, now.remedy);
  }

 private:
  static constexpr std::chrono::nanoseconds kTick = std::chrono::milliseconds(100);
  /// Datagrams handled before the clock is looked at again, so that a flood does not stop the
  /// ticks.
  static constexpr int kDatagramsAtOnce = 64;
  static constexpr double kMillion = 1e6;
  /// The time for which a refusal is worth a report.
  static constexpr std::chrono::nanoseconds kProblemLasts = std::chrono::seconds(5);

  static uint64_t random_session() {
    uint64_t session = 0;
    if (::getrandom(&session, sizeof session, 0) != static_cast<ssize_t>(sizeof session))
      throw Error(ErrorKind::Failed, "--step: the kernel has no random numbers");
    return session;
  }

  static double milli(std::chrono::nanoseconds time) {
    return std::chrono::duration<double, std::milli>(time).count();
  }

  static const char* state_of(const StepPlace& place, size_t peers) {
    if (peers == 0) return "alone";
    return place.in_step != 0 ? "in step" : "joining";
  }

  static nlohmann::ordered_json json_of(const StepMessageCounts& counts, uint64_t sent) {
    return {{"sent", sent},
            {"accepted", counts.accepted},
            {"refused_format", counts.refused_format},
            {"refused_key", counts.refused_key},
            {"refused_group", counts.refused_group},
            {"refused_replayed", counts.refused_replayed},
            {"refused_untimely", counts.refused_untimely},
            {"refused_stranger", counts.refused_stranger}};
  }

  static nlohmann::ordered_json json_of(const ClockAccuracy& accuracy, uint64_t steps) {
    return {{"synchronised", accuracy.synchronised},
            {"offset_us", accuracy.offset_us},
            {"estimated_error_us", accuracy.estimated_us},
            {"largest_error_us", accuracy.bound_us},
            {"steps", steps}};
  }
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

  /// Runs until the link is destroyed. An exception here must not end the playback.
  void run(const std::stop_token& stop) noexcept {
    std::chrono::nanoseconds next_tick{0};
    while (!stop.stop_requested()) {
      const std::chrono::nanoseconds left = next_tick - read_clocks().monotonic;
      const auto wait =
          std::chrono::ceil<std::chrono::milliseconds>(std::max(left, std::chrono::nanoseconds{0}));
      pollfd entries[2] = {{.fd = socket_.fd(), .events = POLLIN, .revents = 0},
                           {.fd = wake_.fd(), .events = POLLIN, .revents = 0}};
      (void)::poll(entries, 2, static_cast<int>(wait.count()));
      try {
        const StepNow now = clock_.now(read_clocks());
        receive_waiting(now);
        if (now.monotonic >= next_tick) {
          tick(now);
          next_tick = now.monotonic + kTick;
        }
      } catch (const std::exception& error) {
        say("step: {}\n", error.what());
      }
    }
  }
  void receive_waiting(const StepNow& now) {
    for (int k = 0; k < kDatagramsAtOnce; ++k) {
      const auto datagram = socket_.receive();
      if (!datagram) return;
      const auto session = member_->receive(datagram->bytes, now);
      if (session && leader_ != nullptr) endpoints_[*session] = datagram->from;
    }
  }
  void tick(const StepNow& now) {
    const StepPlace place = pacing_.place();
    std::erase_if(endpoints_, [&](const auto& entry) { return !member_->alive(entry.first, now); });
    uint64_t sent = 0;
    if (const auto message = member_->tick(place, now)) {
      if (leader_ == nullptr) {
        socket_.send(options_.address.endpoint, *message);
        ++sent;
      }
      for (const auto& [session, endpoint] : endpoints_) {
        socket_.send(endpoint, *message);
        ++sent;
      }
    }
    if (const auto& timeline = member_->timeline())
      pacing_.follow(timeline->on_clock_ahead_by(-clock_.ahead_of_monotonic()));
    {
      const std::lock_guard lock(mutex_);
      status_.sent += sent;
    }
    update_status(place, now);
  }
  void update_status(const StepPlace& place, const StepNow& now) {
    Status status = this->status();
    if (member_->counts().refused_untimely > status.counts.refused_untimely)
      untimely_until_ = now.monotonic + kProblemLasts;
    status.counts = member_->counts();
    status.peers = member_->peers(now);
    if (leader_ != nullptr) status.apart = leader_->apart(place, now);
    status.largest_apart = std::max(status.largest_apart, status.apart);
    status.clock_steps = clock_.steps();
    status.ahead_of_monotonic = clock_.ahead_of_monotonic();
    status.accuracy = read_clock_accuracy();
    status.problem.clear();
    status.remedy.clear();
    find_problem(place, now, status);
    const std::lock_guard lock(mutex_);
    status_ = std::move(status);
  }
  /// Names the first thing that keeps the players apart, and its remedy.
  void find_problem(const StepPlace& place, const StepNow& now, Status& status) const {
    const std::chrono::nanoseconds half_vblank{place.period_ns / 2};
    const auto bound = std::chrono::microseconds(status.accuracy.bound_us);
    const uint64_t frames = member_->timeline() ? member_->timeline()->loop_frames : 0;
    if (frames > 0 && place.loop_frames > 0 && frames != place.loop_frames) {
      status.problem = fmt::format("this film has {} frames, that of the group has {}",
                                   place.loop_frames, frames);
      status.remedy = "play films of the same length and rate on all players";
    } else if (options_.address.is_unix) {
      return;  // one machine has one clock
    } else if (now.monotonic < untimely_until_) {
      status.problem = fmt::format(
          "messages are {:.0f} ms old by this machine's clock, and refused: the clocks differ",
          milli(member_->untimely_age()));
      status.remedy = "let chrony or PTP set the clock of each machine; see: chronyc tracking";
    } else if (!status.accuracy.synchronised) {
      status.problem = "the clock of this machine is not synchronised";
      status.remedy = "run chrony or PTP on each machine; see: chronyc tracking";
    } else if (half_vblank > std::chrono::nanoseconds{0} && bound > half_vblank) {
      status.problem = fmt::format(
          "the clock of this machine may be wrong by {:.1f} ms, more than half a "
          "vblank ({:.1f} ms)",
          milli(bound), milli(half_vblank));
      status.remedy = "use a time server in the local network, or PTP";
    }
  }
  [[nodiscard]] Status status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }

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
  std::jthread thread_;  ///< last member: ends before the others are destroyed
};

}  // namespace lenticule::player
