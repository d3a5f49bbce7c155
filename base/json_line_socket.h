// SPDX-License-Identifier: Apache-2.0
// JsonLineSocket is the client end of a Unix socket over which each side sends lines of JSON:
// the control socket of a player. No call waits longer than it is told.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/packet.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "base/unix_address.h"

namespace lenticule {

/// Thread safety: one thread.
class JsonLineSocket {
 public:
  struct Options {
    size_t most_bytes;      ///< limit of a line; a longer one means that the peer is no player
    std::string no_player;  ///< remedy if nothing listens
    std::string gone;       ///< remedy if the player closes the connection
  };
  /// Throws Error(Device) if no player accepts the connection within `timeout`.
  JsonLineSocket(const std::string& socket, std::chrono::milliseconds timeout, Options options)
      : socket_(socket), timeout_(timeout), options_(std::move(options)) {
    const UnixAddress address = unix_address(socket);
    const auto deadline = Clock::now() + timeout;
    do {
      fd_ = UniqueFd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
      if (fd_ && ::connect(fd_.get(), address.get(), address.bytes) == 0) return;
      if (errno != EAGAIN && errno != EINTR) break;  // else its queue is full
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    } while (Clock::now() < deadline);
    fail_to_connect(errno);
  }

  /// Throws Error(Device) if the player does not read. Returns normally if the player closed the
  /// connection: the reason may still be read.
  void send(const nlohmann::ordered_json& request) {
    const std::string line = json_text(request) + "\n";
    const auto deadline = Clock::now() + timeout_;
    for (size_t sent = 0; sent < line.size();) {
      const ssize_t more = ::send(fd_.get(), line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
      if (more > 0) sent += static_cast<size_t>(more);
      if (more > 0 || (more < 0 && errno == EINTR)) continue;
      // A player that refuses a connection sends the reason before it closes the socket.
      if (more == 0 || errno != EAGAIN) return;
      pollfd entry{.fd = fd_.get(), .events = POLLOUT, .revents = 0};
      if (poll(&entry, 1, left_ms(deadline)) <= 0)
        throw device_error("{}: the player does not read", socket_).remedy(options_.gone);
    }
  }
  /// Returns the next line; none if no line arrived in time or `stop_fd` is readable. Throws
  /// Error(Device) if the player closed the connection and Error(Failed) if the line is not a JSON
  /// object.
  [[nodiscard]] std::optional<nlohmann::ordered_json> receive(std::chrono::milliseconds timeout,
                                                              int stop_fd = -1) {
    const auto deadline = Clock::now() + timeout;
    while (true) {
      if (auto line = take_line()) return line;
      std::array<pollfd, 2> entries{{{.fd = fd_.get(), .events = POLLIN, .revents = 0},
                                     {.fd = stop_fd, .events = POLLIN, .revents = 0}}};
      const int ready = poll(entries.data(), entries.size(), left_ms(deadline));
      if (ready < 0 && errno == EINTR) continue;
      if (ready <= 0 || entries[1].revents != 0) return std::nullopt;
      if (!read_more()) fail_gone();
    }
  }
  /// Returns the descriptor that arrived with the last lines; empty if none did.
  [[nodiscard]] UniqueFd take_descriptor() { return std::move(descriptor_); }

 private:
  using Clock = std::chrono::steady_clock;
  using ordered_json = nlohmann::ordered_json;

  static int left_ms(Clock::time_point deadline) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    return static_cast<int>(std::clamp<int64_t>(left.count(), 0, 60'000));
  }
  [[nodiscard]] std::optional<nlohmann::ordered_json> take_line() {
    const size_t end = in_.find('\n');
    if (end == std::string::npos) return std::nullopt;
    ordered_json line = ordered_json::parse(in_.substr(0, end), nullptr, false);
    in_.erase(0, end + 1);
    if (!line.is_object())
      throw failed_error("{}: the other end does not speak the control protocol", socket_);
    return line;
  }
  /// Reads what is there, and the descriptor that comes with it. Returns false at the end.
  [[nodiscard]] bool read_more() {
    std::array<char, 16384> bytes{};
    const ssize_t got =
        receive_packet(fd_.get(), bytes.data(), bytes.size(), &descriptor_, MSG_DONTWAIT);
    if (got < 0 && errno == EAGAIN) return true;
    if (got <= 0 || in_.size() > options_.most_bytes) return false;
    in_.append(bytes.data(), static_cast<size_t>(got));
    return true;
  }
  [[noreturn]] void fail_gone() const {
    throw device_error("{}: the player closed the connection", socket_).remedy(options_.gone);
  }
  [[noreturn]] void fail_to_connect(int error) const {
    struct stat status {};
    if (error == EACCES || error == EPERM)
      throw device_error("{}: {}", socket_, std::strerror(error))
          .remedy("use the player's account, root, or a member of the player's --control-group");
    if (error == ECONNREFUSED && ::stat(socket_.c_str(), &status) == 0 && !S_ISSOCK(status.st_mode))
      throw device_error("{}: it is {}, not a socket", socket_, kind_of_file(status.st_mode))
          .remedy("name the socket that a player was started with: --control SOCKET");
    throw device_error("{}: no player: {}", socket_, std::strerror(error))
        .remedy(options_.no_player);
  }

  std::string socket_;
  std::chrono::milliseconds timeout_;
  Options options_;
  UniqueFd fd_;
  UniqueFd descriptor_;
  std::string in_;
};

}  // namespace lenticule
