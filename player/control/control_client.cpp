// SPDX-License-Identifier: Apache-2.0
#include "player/control/control_client.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "frames/ring/listen_socket.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using nlohmann::ordered_json;

/// Upper limit of an answer in bytes. Answers of a player are far smaller, so a longer one means
/// that the peer is not a player.
constexpr size_t kMaxAnswer = 8u << 20;

[[noreturn]] void fail_gone(const std::string& socket) {
  throw Error(ErrorKind::Device, socket + ": the player closed the connection");
}

int left_ms(Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
  return static_cast<int>(std::clamp<int64_t>(left.count(), 0, 60'000));
}

}  // namespace

ControlClient::ControlClient(const std::string& socket, std::chrono::milliseconds timeout)
    : socket_(socket), timeout_(timeout) {
  const frames::UnixAddress address = frames::unix_address(socket);
  const auto deadline = Clock::now() + timeout;
  do {
    fd_ = UniqueFd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (fd_ && ::connect(fd_.get(), address.get(), address.bytes) == 0) return;
    if (errno != EAGAIN && errno != EINTR) break;  // else its queue is full
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  } while (Clock::now() < deadline);
  throw Error(ErrorKind::Device, fmt::format("{}: no player: {}", socket, std::strerror(errno)),
              "start one: lenticule play SOURCE --rig RIG --control " + socket);
}

void ControlClient::send(const ordered_json& request) {
  const std::string line = json_text(request) + "\n";
  const auto deadline = Clock::now() + timeout_;
  for (size_t sent = 0; sent < line.size();) {
    const ssize_t more = ::send(fd_.get(), line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (more > 0) sent += static_cast<size_t>(more);
    if (more > 0 || (more < 0 && errno == EINTR)) continue;
    pollfd entry{.fd = fd_.get(), .events = POLLOUT, .revents = 0};
    const bool later = more < 0 && errno == EAGAIN;
    // A player that refuses a connection sends the reason before it closes the socket, so the
    // reason is still read.
    if (!later) return;
    if (poll(&entry, 1, left_ms(deadline)) <= 0) fail_gone(socket_);
  }
}

std::optional<ordered_json> ControlClient::take_line() {
  const size_t end = in_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  ordered_json line = ordered_json::parse(in_.substr(0, end), nullptr, false);
  in_.erase(0, end + 1);
  if (!line.is_object())
    throw Error(ErrorKind::Failed, socket_ + ": the other end does not speak the control protocol");
  return line;
}

std::optional<ordered_json> ControlClient::receive(std::chrono::milliseconds timeout, int stop_fd) {
  const auto deadline = Clock::now() + timeout;
  while (true) {
    if (auto line = take_line()) return line;
    std::array<pollfd, 2> entries{{{.fd = fd_.get(), .events = POLLIN, .revents = 0},
                                   {.fd = stop_fd, .events = POLLIN, .revents = 0}}};
    const int ready = poll(entries.data(), entries.size(), left_ms(deadline));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0 || entries[1].revents != 0) return std::nullopt;
    std::array<char, 16384> bytes{};
    const ssize_t got = ::recv(fd_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (got <= 0 || in_.size() > kMaxAnswer) fail_gone(socket_);
    in_.append(bytes.data(), static_cast<size_t>(got));
  }
}

std::string only_control_socket() {
  std::vector<std::string> found;
  std::error_code ignored;
  for (fs::directory_iterator entry("/run/lenticule", ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const fs::path socket = entry->path() / "control.sock";
    std::error_code missing;
    if (fs::is_socket(socket, missing)) found.push_back(socket.string());
  }
  if (found.size() == 1) return found.front();
  if (found.empty())
    throw Error(ErrorKind::Usage, "--socket: no player service runs on this machine",
                "give the socket of a player: lenticule play ... --control SOCKET");
  throw Error(ErrorKind::Usage,
              fmt::format("--socket: {} player services run on this machine", found.size()),
              "give the socket of one: --socket " + found.front());
}

}  // namespace lenticule::player
