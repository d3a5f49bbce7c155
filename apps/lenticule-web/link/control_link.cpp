// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/link/control_link.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <thread>

#include "base/text.h"
#include "frames/ring/listen_socket.h"

namespace lenticule::web {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::ordered_json;

constexpr size_t kMaxAnswer = 1u << 20;

[[noreturn]] void fail(const std::string& socket, const std::string& cause) {
  throw Error(ErrorKind::Device, socket + ": " + cause, "start the player, or wait for it");
}

int left_ms(Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
  return static_cast<int>(std::clamp<int64_t>(left.count(), 0, 60'000));
}

[[noreturn]] void throw_error_of(const ordered_json& answer) {
  const auto error = answer.value("error", ordered_json::object());
  const auto text = [&](const char* key) {
    return error.is_object() && error.contains(key) && error[key].is_string()
               ? error[key].get<std::string>()
               : std::string();
  };
  const bool has_kind =
      error.is_object() && error.contains("kind") && error["kind"].is_number_integer();
  const int kind = has_kind ? error["kind"].get<int>() : 1;
  const std::string object = text("object");
  throw Error(kind >= 1 && kind <= 5 ? static_cast<ErrorKind>(kind) : ErrorKind::Failed,
              object.empty() ? text("cause") : object + ": " + text("cause"), text("remedy"));
}

}  // namespace

LinkConnection::LinkConnection(const std::string& socket, std::chrono::milliseconds timeout)
    : socket_(socket), timeout_(timeout) {
  const frames::UnixAddress address = frames::unix_address(socket);
  const auto deadline = Clock::now() + timeout;
  do {
    fd_ = UniqueFd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (fd_ && ::connect(fd_.get(), address.get(), address.bytes) == 0) return;
    if (errno != EAGAIN && errno != EINTR) break;  // else its queue is full
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  } while (Clock::now() < deadline);
  fail(socket, fmt::format("no player: {}", std::strerror(errno)));
}

void LinkConnection::send(const ordered_json& request) {
  const std::string line = json_text(request) + "\n";
  const auto deadline = Clock::now() + timeout_;
  for (size_t sent = 0; sent < line.size();) {
    const ssize_t more = ::send(fd_.get(), line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (more > 0) sent += static_cast<size_t>(more);
    if (more > 0 || (more < 0 && errno == EINTR)) continue;
    // A player that refuses a connection sends the reason before it closes the socket.
    if (more == 0 || errno != EAGAIN) return;
    pollfd entry{.fd = fd_.get(), .events = POLLOUT, .revents = 0};
    if (poll(&entry, 1, left_ms(deadline)) <= 0) fail(socket_, "the player does not read");
  }
}

std::optional<ordered_json> LinkConnection::take_line() {
  const size_t end = in_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  ordered_json line = ordered_json::parse(in_.substr(0, end), nullptr, false);
  in_.erase(0, end + 1);
  if (!line.is_object()) fail(socket_, "the other end does not speak the control protocol");
  return line;
}

/// Reads what is there, and the descriptor that comes with it. Returns false at the end.
bool LinkConnection::read_more() {
  std::array<char, 16384> bytes{};
  iovec part{.iov_base = bytes.data(), .iov_len = bytes.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t got = ::recvmsg(fd_.get(), &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return true;
  const cmsghdr* const header = got >= 0 ? CMSG_FIRSTHDR(&message) : nullptr;
  if (header != nullptr && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_RIGHTS) {
    int fd = -1;
    std::memcpy(&fd, CMSG_DATA(header), sizeof fd);
    descriptor_ = UniqueFd(fd);
  }
  if (got <= 0 || in_.size() > kMaxAnswer) return false;
  in_.append(bytes.data(), static_cast<size_t>(got));
  return true;
}

std::optional<ordered_json> LinkConnection::receive(std::chrono::milliseconds timeout,
                                                    int stop_fd) {
  const auto deadline = Clock::now() + timeout;
  while (true) {
    if (auto line = take_line()) return line;
    std::array<pollfd, 2> entries{{{.fd = fd_.get(), .events = POLLIN, .revents = 0},
                                   {.fd = stop_fd, .events = POLLIN, .revents = 0}}};
    const int ready = poll(entries.data(), entries.size(), left_ms(deadline));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0 || entries[1].revents != 0) return std::nullopt;
    if (!read_more()) fail(socket_, "the player closed the connection");
  }
}

ControlLink::Answer ControlLink::ask(ordered_json request, std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  if (!slots_.try_acquire_until(deadline)) fail(socket_, "the player is busy with other requests");
  struct Slot {
    std::counting_semaphore<4>& slots;
    ~Slot() { slots.release(); }
  } const slot{slots_};
  LinkConnection connection(socket_, timeout);
  request["id"] = 1;
  connection.send(request);
  auto body = connection.receive(std::chrono::milliseconds(left_ms(deadline)));
  if (!body) fail(socket_, "no answer from the player");
  if (!body->contains("ok") || (*body)["ok"] != true) throw_error_of(*body);
  body->erase("id");
  body->erase("ok");
  return {.body = std::move(*body), .descriptor = connection.take_descriptor()};
}

}  // namespace lenticule::web
