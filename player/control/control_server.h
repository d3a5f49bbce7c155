// SPDX-License-Identifier: Apache-2.0
// ControlServer listens on a player's control socket on its own thread, so that slow or broken
// clients cannot delay the playback threads.
#pragma once

#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "base/error_kinds.h"
#include "base/print.h"
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
[[nodiscard]] inline ControlRights rights_of(const ControlPeer& peer, const ControlPolicy& policy) {
  if (peer.uid == policy.owner || peer.uid == 0) return ControlRights::Everything;
  const bool member =
      policy.group && std::ranges::find(peer.groups, *policy.group) != peer.groups.end();
  return member ? ControlRights::Steer : ControlRights::None;
}

/// Returns the peer's credentials as reported by the kernel; none if the kernel does not report
/// them.
[[nodiscard]] inline std::optional<ControlPeer> peer_of(int socket) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return std::nullopt;
  ControlPeer peer{.uid = credentials.uid, .groups = {credentials.gid}};
  std::array<gid_t, 1024> more{};
  size = sizeof more;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, more.data(), &size) == 0)
    peer.groups.insert(peer.groups.end(), more.begin(),
                       more.begin() + static_cast<ptrdiff_t>(size / sizeof(gid_t)));
  return peer;
}

/// Returns the group's id. Throws Error(Usage) if there is no group of that name.
[[nodiscard]] inline gid_t group_named(const std::string& name) {
  std::array<char, 16384> strings{};
  group entry{};
  group* found = nullptr;
  (void)::getgrnam_r(name.c_str(), &entry, strings.data(), strings.size(), &found);
  if (found != nullptr) return found->gr_gid;
  throw usage_error("--control-group '{}': no such group", name).remedy("getent group lists them");
}

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
  ControlServer(ControlServerOptions options, ControlTarget& target)
      : options_(std::move(options)),
        policy_{.owner = geteuid(), .group = options_.group},
        target_(target),
        socket_(options_.socket, {.type = SOCK_STREAM, .group = options_.group}),
        inbox_(std::make_shared<Inbox>()) {
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }
  ~ControlServer() {
    thread_.request_stop();
    inbox_->wake.signal();
  }

  /// Sends the event to every subscriber. Thread safety: any thread; never waits for a client.
  void publish(nlohmann::ordered_json event) {
    {
      const std::lock_guard lock(inbox_->mutex);
      if (inbox_->events.size() < kMaxQueuedEvents)
        inbox_->events.push_back(std::move(event));
      else
        ++inbox_->events_left_out;
    }
    inbox_->wake.signal();
  }
  [[nodiscard]] ControlCounts counts() const {
    return {.accepted = accepted_.load(),
            .refused = refused_.load(),
            .dropped = dropped_.load(),
            .displaced = displaced_.load()};
  }

 private:
  using json = nlohmann::json;
  using ordered_json = nlohmann::ordered_json;
  static constexpr size_t kMaxQueuedEvents = 256;
  /// Connections accepted per round. Fewer than the client limit, so that a new client's request is
  /// read before the client may be displaced.
  static constexpr int kAcceptsAtOnce = 8;
  static constexpr auto kAcceptPause = std::chrono::milliseconds(100);
  static constexpr int kTickMs = 500;

  /// Sends the error and closes the connection. Best effort: the error is lost if the socket cannot
  /// take it at once.
  static void report_and_close(const UniqueFd& fd, const Error& error) {
    const std::string line = error_line(nullptr, error);
    (void)::send(fd.get(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }

  /// Returns true for verbs that open content, or write it, which may take as long as that takes.
  static bool takes_content(std::string_view verb) {
    constexpr std::array<std::string_view, 12> kQuick = {"status", "play",  "pause", "loop",
                                                         "speed",  "power", "trim",  "rig",
                                                         "frame",  "list",  "stats", "doctor"};
    return std::ranges::find(kQuick, verb) == kQuick.end();
  }

  static std::string line_of(const json& id, const ControlAnswer& answer) {
    if (const auto* const error = std::get_if<Error>(&answer)) return error_line(id, *error);
    if (const auto* const conflict = std::get_if<ConflictAnswer>(&answer))
      return error_line(id, conflict->error, true);
    if (const auto* const with = std::get_if<DescriptorAnswer>(&answer))
      return answer_line(id, with->body);
    return answer_line(id, std::get<ordered_json>(answer));
  }
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
      std::string_view verb{};
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

  /// Runs the server loop. An exception here must not end the playback.
  void serve(const std::stop_token& stop) noexcept {
    const auto guarded = [this](void (ControlServer::*step)()) {
      try {
        (this->*step)();
      } catch (const std::exception& error) {
        say("control: {}\n", error.what());
        for (const auto& client : clients_) client->dead = true;
      }
      std::erase_if(clients_, [](const auto& client) { return client->dead; });
    };
    while (!stop.stop_requested()) guarded(&ControlServer::serve_once);
    // The last answers, for example that of the request that ends the player.
    guarded(&ControlServer::take_inbox);
    for (const auto& client : clients_) flush(*client);
  }
  void serve_once() {
    std::vector<pollfd> entries;
    const bool accepts = Clock::now() >= accepts_again_;
    entries.push_back({.fd = inbox_->wake.fd(), .events = POLLIN, .revents = 0});
    entries.push_back({.fd = accepts ? socket_.fd() : -1, .events = POLLIN, .revents = 0});
    for (const auto& client : clients_) {
      const int events = (reads(*client) ? POLLIN : 0) | (client->out.empty() ? 0 : POLLOUT);
      entries.push_back(
          {.fd = client->fd.get(), .events = static_cast<short>(events), .revents = 0});
    }
    if (poll(entries.data(), entries.size(), accepts ? kTickMs : 100) < 0) return;

    for (size_t k = 2; k < entries.size(); ++k) {
      Client& client = *clients_[k - 2];
      const int happened = entries[k].revents;
      if ((happened & POLLIN) != 0) receive(client);
      if ((happened & POLLOUT) != 0) flush(client);
      const bool gone = (happened & (POLLERR | POLLNVAL)) != 0 ||
                        ((happened & POLLHUP) != 0 && (happened & POLLIN) == 0);
      if (gone) client.dead = true;
    }
    if (entries[0].revents != 0) take_inbox();
    for (const auto& client : clients_) {
      take_lines(*client);
      give_up_late(*client);
      flush(*client);
      drop_stuck(*client);
    }
    if (entries[1].revents != 0) accept_all();
  }
  /// Returns true if more may be read from the client: not while too many requests are unanswered
  /// or too much output is pending.
  [[nodiscard]] bool reads(const Client& client) const {
    return !client.closing && !client.sent_all &&
           client.unanswered.size() < options_.limits.unanswered &&
           client.out.size() < options_.limits.waiting_bytes;
  }
  void accept_all() {
    std::erase_if(clients_, [](const auto& client) { return client->dead; });
    for (int k = 0; k < kAcceptsAtOnce; ++k) {
      UniqueFd fd = socket_.accept();
      if (fd) {
        admit(std::move(fd));
      } else {
        // Possibly out of descriptors. The pending connection stays readable, so an immediate retry
        // would spin.
        if (errno != EAGAIN && errno != EWOULDBLOCK) accepts_again_ = Clock::now() + kAcceptPause;
        return;
      }
    }
  }
  void admit(UniqueFd fd) {
    const std::optional<ControlPeer> peer = options_.peer(fd.get());
    const ControlRights rights = peer ? rights_of(*peer, policy_) : ControlRights::None;
    if (rights == ControlRights::None) {
      refused_.fetch_add(1);
      return report_and_close(fd,
                              {ErrorKind::Device, "control: the player belongs to another user",
                               "connect as its user, as root, or as a member of --control-group"});
    }
    if (clients_.size() >= options_.limits.clients && !make_room(rights)) {
      refused_.fetch_add(1);
      return report_and_close(
          fd, {ErrorKind::Device,
               fmt::format("control: {} clients are connected and busy", options_.limits.clients),
               "close one of them, or try again when one is idle"});
    }
    accepted_.fetch_add(1);
    auto client = std::make_unique<Client>();
    client->fd = std::move(fd);
    client->number = next_client_++;
    client->rights = rights;
    client->event_tokens = options_.limits.events_per_second;
    client->tokens_at = client->took_at = client->asked_at = Clock::now();
    clients_.push_back(std::move(client));
  }
  /// Disconnects the client that has been idle for longest: clients that did nothing before
  /// subscribers, the group's before the owner's. For the owner and root a client is always
  /// disconnected; for others only one without a recent request.
  [[nodiscard]] bool make_room(ControlRights newcomer) {
    const Clock::time_point idle_since = Clock::now() - options_.limits.idle;
    const bool always = newcomer == ControlRights::Everything;
    const auto is_busy = [](const Client& client) {
      return !client.unanswered.empty() || !client.out.empty();
    };
    const auto order = [&](const std::unique_ptr<Client>& client) {
      return std::tuple(is_busy(*client), client->subscribed,
                        client->rights == ControlRights::Everything, client->asked_at);
    };
    const auto victim = std::ranges::min_element(
        clients_, [&](const auto& a, const auto& b) { return order(a) < order(b); });
    if (victim == clients_.end()) return false;
    const bool idle = !is_busy(**victim) && (*victim)->asked_at <= idle_since;
    if (!idle && !always) return false;
    displaced_.fetch_add(1);
    report_and_close(
        (*victim)->fd,
        {ErrorKind::Device, "control: disconnected, because another client needed the connection",
         "connect again for the next request"});
    clients_.erase(victim);
    return true;
  }
  void receive(Client& client) {
    std::array<char, 16384> bytes{};
    const ssize_t got = ::recv(client.fd.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
    client.dead = got < 0;
    client.sent_all = got == 0;
    if (got <= 0) return;
    client.in.append(bytes.data(), static_cast<size_t>(got));
  }
  void take_lines(Client& client) {
    size_t begin = 0;
    const auto has_room = [&] {
      return !client.dead && !client.closing &&
             client.unanswered.size() < options_.limits.unanswered &&
             client.out.size() < options_.limits.waiting_bytes;
    };
    bool more = true;
    while (has_room() && more) {
      const size_t end = client.in.find('\n', begin);
      more = end != std::string::npos;
      if (!more) break;
      std::string line = client.in.substr(begin, end - begin);
      begin = end + 1;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (!line.empty()) take_line(client, line);
    }
    client.in.erase(0, begin);
    if (client.sent_all && !more && client.unanswered.empty() && !client.subscribed)
      client.closing = true;
    const bool too_long = client.in.size() > kMaxControlLine &&
                          client.in.find('\n') == std::string::npos && !client.closing;
    if (!too_long) return;
    dropped_.fetch_add(1);
    client.in.clear();
    client.closing = true;
    queue(client,
          error_line(nullptr, {ErrorKind::Usage,
                               fmt::format("request: longer than {} bytes", kMaxControlLine),
                               "send one request per line"}));
  }
  void take_line(Client& client, const std::string& line) {
    json id;
    client.asked_at = Clock::now();
    try {
      const ControlRequest request = parse_control_request(line, id);
      if (request.verb == "subscribe") {
        client.subscribed = true;
        return queue(client, answer_line(id, {{"subscribed", true}}));
      }
      const uint64_t number = next_request_++;
      client.unanswered[number] = {.id = id, .verb = request.verb, .at = client.asked_at};
      const auto answer = [inbox = inbox_, client = client.number, number,
                           id](const ControlAnswer& result) {
        std::string text = line_of(id, result);
        const auto* const with = std::get_if<DescriptorAnswer>(&result);
        {
          const std::lock_guard lock(inbox->mutex);
          inbox->answers.push_back({.client = client,
                                    .request = number,
                                    .text = std::move(text),
                                    .descriptor = with != nullptr ? with->descriptor : nullptr});
        }
        inbox->wake.signal();
      };
      try {
        target_.handle(request, client.rights, answer);
      } catch (const Error& error) {
        answer(error);
      }
    } catch (const Error& error) {
      queue(client, error_line(id, error));
    }
  }
  void take_inbox() {
    inbox_->wake.drain();
    std::vector<Inbox::Line> answers;
    std::deque<ordered_json> events;
    {
      const std::lock_guard lock(inbox_->mutex);
      answers.swap(inbox_->answers);
      events.swap(inbox_->events);
      if (const uint64_t left_out = std::exchange(inbox_->events_left_out, 0); left_out > 0)
        events.push_back({{"event", "left_out"}, {"events", left_out}});
    }
    for (const Inbox::Line& answer : answers)
      for (const auto& client : clients_)
        if (client->number == answer.client && client->unanswered.erase(answer.request) > 0)
          queue(*client, answer.text, answer.descriptor);
    for (const ordered_json& event : events)
      for (const auto& client : clients_)
        if (client->subscribed) send_event(*client, event);
  }
  void send_event(Client& client, const nlohmann::ordered_json& event) {
    const Clock::time_point now = Clock::now();
    const double most = options_.limits.events_per_second;
    const double seconds = std::chrono::duration<double>(now - client.tokens_at).count();
    client.tokens_at = now;
    client.event_tokens = std::min(most, client.event_tokens + seconds * most);
    if (client.event_tokens < 1.0) {
      ++client.events_left_out;
      return;
    }
    client.event_tokens -= 1.0;
    ordered_json line = event;
    if (client.events_left_out > 0) line["left_out"] = std::exchange(client.events_left_out, 0);
    queue(client, event_line(line));
  }
  void queue(Client& client, const std::string& line,
             const std::shared_ptr<const UniqueFd>& descriptor = nullptr) {
    if (client.dead) return;
    if (client.out.empty()) client.took_at = Clock::now();
    if (descriptor) client.passed.push_back({.at = client.out.size(), .descriptor = descriptor});
    client.out += line;
    if (client.out.size() <= options_.limits.dropped_bytes) return;
    dropped_.fetch_add(1);
    client.dead = true;
  }
  /// Sends the pending output up to the next line with a descriptor; at that line, the line with
  /// its descriptor. Returns the result of sendmsg().
  [[nodiscard]] static ssize_t send_some(Client& client) {
    std::deque<Client::Passed>& passed = client.passed;
    const bool passes = !passed.empty() && passed.front().at == 0;
    const size_t next = passes ? 1 : 0;
    const size_t bytes = passed.size() > next ? passed[next].at : client.out.size();
    iovec part{.iov_base = client.out.data(), .iov_len = bytes};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    if (passes) {
      message.msg_control = control.data();
      message.msg_controllen = control.size();
      cmsghdr* const header = CMSG_FIRSTHDR(&message);
      header->cmsg_level = SOL_SOCKET;
      header->cmsg_type = SCM_RIGHTS;
      header->cmsg_len = CMSG_LEN(sizeof(int));
      const int fd = passed.front().descriptor->get();
      std::memcpy(CMSG_DATA(header), &fd, sizeof fd);
    }
    const ssize_t sent = ::sendmsg(client.fd.get(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent <= 0) return sent;
    if (passes) passed.pop_front();
    for (Client::Passed& later : passed) later.at -= static_cast<size_t>(sent);
    return sent;
  }
  void flush(Client& client) {
    while (!client.dead && !client.out.empty()) {
      const ssize_t sent = send_some(client);
      if (sent < 0 && errno == EINTR) continue;
      if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
      if (sent < 0) client.dead = true;
      if (sent <= 0) return;
      client.out.erase(0, static_cast<size_t>(sent));
      client.took_at = Clock::now();
    }
    if (client.closing && client.out.empty()) client.dead = true;
  }
  /// Answers requests that the target does not answer in time; a later answer is left out. A disk
  /// or a decoder may hang for ever.
  void give_up_late(Client& client) {
    const Clock::time_point now = Clock::now();
    std::erase_if(client.unanswered, [&](const auto& entry) {
      const auto& [id, verb, at] = entry.second;
      const auto limit = takes_content(verb) ? options_.limits.opening : options_.limits.answer;
      if (now - at < limit) return false;
      queue(client,
            error_line(id, {ErrorKind::Failed,
                            fmt::format("{}: not done after {:.0f} s", verb,
                                        std::chrono::duration<double>(limit).count()),
                            "it may still be done: 'status' says what the player is doing"}));
      return true;
    });
  }
  void drop_stuck(Client& client) {
    if (client.dead || client.out.empty()) return;
    if (Clock::now() - client.took_at < options_.limits.stuck) return;
    dropped_.fetch_add(1);
    client.dead = true;
  }

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
  std::jthread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
