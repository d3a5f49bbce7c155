// SPDX-License-Identifier: Apache-2.0
#include "player/control/control_server.h"

#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/print.h"

namespace lenticule::player {

ControlRights rights_of(const ControlPeer& peer, const ControlPolicy& policy) {
  if (peer.uid == policy.owner || peer.uid == 0) return ControlRights::Everything;
  const bool member = policy.group && std::find(peer.groups.begin(), peer.groups.end(),
                                                *policy.group) != peer.groups.end();
  return member ? ControlRights::Steer : ControlRights::None;
}

std::optional<ControlPeer> peer_of(int socket) {
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

gid_t group_named(const std::string& name) {
  std::array<char, 16384> strings{};
  group entry{};
  group* found = nullptr;
  (void)::getgrnam_r(name.c_str(), &entry, strings.data(), strings.size(), &found);
  if (found != nullptr) return found->gr_gid;
  throw Error(ErrorKind::Usage, fmt::format("--control-group '{}': no such group", name),
              "getent group lists them");
}

namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr size_t kMaxQueuedEvents = 256;
/// Connections accepted per round. Fewer than the client limit, so that a new client's request is
/// read before the client may be displaced.
constexpr int kAcceptsAtOnce = 8;
constexpr auto kAcceptPause = std::chrono::milliseconds(100);
constexpr int kTickMs = 500;

/// Sends the error and closes the connection. Best effort: the error is lost if the socket cannot
/// take it at once.
void report_and_close(const UniqueFd& fd, const Error& error) {
  const std::string line = error_line(nullptr, error);
  (void)::send(fd.get(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

/// Returns true for verbs that open content, or write it, which may take as long as that takes.
bool takes_content(ControlVerb verb) {
  constexpr std::array kQuick = {ControlVerb::Status, ControlVerb::Play,  ControlVerb::Pause,
                                 ControlVerb::Loop,   ControlVerb::Speed, ControlVerb::Power,
                                 ControlVerb::Trim,   ControlVerb::Rig,   ControlVerb::Frame,
                                 ControlVerb::List,   ControlVerb::Stats, ControlVerb::Doctor};
  return std::ranges::find(kQuick, verb) == kQuick.end();
}

std::string line_of(const json& id, const ControlAnswer& answer) {
  if (const auto* const error = std::get_if<Error>(&answer)) return error_line(id, *error);
  if (const auto* const conflict = std::get_if<ConflictAnswer>(&answer))
    return error_line(id, conflict->error, true);
  if (const auto* const with = std::get_if<DescriptorAnswer>(&answer))
    return answer_line(id, with->body);
  return answer_line(id, std::get<ordered_json>(answer));
}

}  // namespace

ControlServer::ControlServer(ControlServerOptions options, ControlTarget& target)
    : options_(std::move(options)),
      policy_{.owner = geteuid(), .group = options_.group},
      target_(target),
      socket_(options_.socket, {.type = SOCK_STREAM, .group = options_.group}),
      inbox_(std::make_shared<Inbox>()) {
  thread_ = std::thread([this] { serve(); });
}

ControlServer::~ControlServer() {
  stopping_.store(true);
  inbox_->wake.signal();
  thread_.join();
}

void ControlServer::publish(ordered_json event) {
  {
    const std::lock_guard lock(inbox_->mutex);
    if (inbox_->events.size() < kMaxQueuedEvents)
      inbox_->events.push_back(std::move(event));
    else
      ++inbox_->events_left_out;
  }
  inbox_->wake.signal();
}

ControlCounts ControlServer::counts() const {
  return {.accepted = accepted_.load(),
          .refused = refused_.load(),
          .dropped = dropped_.load(),
          .displaced = displaced_.load()};
}

/// Runs the server loop. An exception here must not end the playback.
void ControlServer::serve() noexcept {
  const auto guarded = [this](void (ControlServer::*step)()) {
    try {
      (this->*step)();
    } catch (const std::exception& error) {
      say("control: {}\n", error.what());
      for (const auto& client : clients_) client->dead = true;
    }
    std::erase_if(clients_, [](const auto& client) { return client->dead; });
  };
  while (!stopping_.load()) guarded(&ControlServer::serve_once);
  // The last answers, for example that of the request that ends the player.
  guarded(&ControlServer::take_inbox);
  for (const auto& client : clients_) flush(*client);
}

/// Returns true if more may be read from the client: not while too many requests are unanswered or
/// too much output is pending.
bool ControlServer::reads(const Client& client) const {
  return !client.closing && !client.sent_all &&
         client.unanswered.size() < options_.limits.unanswered &&
         client.out.size() < options_.limits.waiting_bytes;
}

void ControlServer::serve_once() {
  std::vector<pollfd> entries;
  const bool accepts = Clock::now() >= accepts_again_;
  entries.push_back({.fd = inbox_->wake.fd(), .events = POLLIN, .revents = 0});
  entries.push_back({.fd = accepts ? socket_.fd() : -1, .events = POLLIN, .revents = 0});
  for (const auto& client : clients_) {
    const int events = (reads(*client) ? POLLIN : 0) | (client->out.empty() ? 0 : POLLOUT);
    entries.push_back({.fd = client->fd.get(), .events = static_cast<short>(events), .revents = 0});
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

// --- connections ----------------------------------------------------------------------------

void ControlServer::accept_all() {
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

void ControlServer::admit(UniqueFd fd) {
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
bool ControlServer::make_room(ControlRights newcomer) {
  const Clock::time_point idle_since = Clock::now() - options_.limits.idle;
  const bool always = newcomer == ControlRights::Everything;
  const auto is_busy = [](const Client& client) {
    return !client.unanswered.empty() || !client.out.empty();
  };
  const auto order = [&](const std::unique_ptr<Client>& client) {
    return std::tuple(is_busy(*client), client->subscribed,
                      client->rights == ControlRights::Everything, client->asked_at);
  };
  const auto victim =
      std::min_element(clients_.begin(), clients_.end(),
                       [&](const auto& a, const auto& b) { return order(a) < order(b); });
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

void ControlServer::receive(Client& client) {
  std::array<char, 16384> bytes{};
  const ssize_t got = ::recv(client.fd.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
  client.dead = got < 0;
  client.sent_all = got == 0;
  if (got <= 0) return;
  client.in.append(bytes.data(), static_cast<size_t>(got));
}

void ControlServer::take_lines(Client& client) {
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
  queue(client, error_line(nullptr, {ErrorKind::Usage,
                                     fmt::format("request: longer than {} bytes", kMaxControlLine),
                                     "send one request per line"}));
}

void ControlServer::take_line(Client& client, const std::string& line) {
  json id;
  client.asked_at = Clock::now();
  try {
    const ControlRequest request = parse_control_request(line, id);
    if (request.verb == ControlVerb::Subscribe) {
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

// --- output ---------------------------------------------------------------------------------

void ControlServer::take_inbox() {
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

void ControlServer::send_event(Client& client, const ordered_json& event) {
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

void ControlServer::queue(Client& client, const std::string& line,
                          const std::shared_ptr<const UniqueFd>& descriptor) {
  if (client.dead) return;
  if (client.out.empty()) client.took_at = Clock::now();
  if (descriptor) client.passed.push_back({.at = client.out.size(), .descriptor = descriptor});
  client.out += line;
  if (client.out.size() <= options_.limits.dropped_bytes) return;
  dropped_.fetch_add(1);
  client.dead = true;
}

/// Sends the pending output up to the next line with a descriptor; at that line, the line with its
/// descriptor. Returns the result of sendmsg().
ssize_t ControlServer::send_some(Client& client) {
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

void ControlServer::flush(Client& client) {
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

/// Answers requests that the target does not answer in time; a later answer is left out. A disk or
/// a decoder may hang for ever.
void ControlServer::give_up_late(Client& client) {
  const Clock::time_point now = Clock::now();
  std::erase_if(client.unanswered, [&](const auto& entry) {
    const auto& [id, verb, at] = entry.second;
    const auto limit = takes_content(verb) ? options_.limits.opening : options_.limits.answer;
    if (now - at < limit) return false;
    queue(client, error_line(id, {ErrorKind::Failed,
                                  fmt::format("{}: not done after {:.0f} s", verb_name(verb),
                                              std::chrono::duration<double>(limit).count()),
                                  "it may still be done: 'status' says what the player is doing"}));
    return true;
  });
}

void ControlServer::drop_stuck(Client& client) {
  if (client.dead || client.out.empty()) return;
  if (Clock::now() - client.took_at < options_.limits.stuck) return;
  dropped_.fetch_add(1);
  client.dead = true;
}

}  // namespace lenticule::player
