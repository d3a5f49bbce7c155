// SPDX-License-Identifier: Apache-2.0
// HttpClient is a connection to a server on this machine that need not follow HTTP.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <map>
#include <string>

#include "base/numbers.h"
#include "base/unique_fd.h"

namespace lenticule::test {

struct HttpAnswer {
  int status = 0;  ///< 0 if the connection ended without an answer
  std::string head;
  std::string body;

  [[nodiscard]] std::string header(const std::string& name) const {
    const size_t at = head.find("\r\n" + name + ": ");
    if (at == std::string::npos) return {};
    const size_t begin = at + name.size() + 4;
    return head.substr(begin, head.find("\r\n", begin) - begin);
  }
};

class HttpClient {
 public:
  /// Connects from `from`, an address of the loopback network such as "127.0.0.9".
  explicit HttpClient(uint16_t port, const std::string& from = "127.0.0.1",
                      std::chrono::seconds timeout = std::chrono::seconds(30)) {
    fd_ = UniqueFd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const timeval limit{.tv_sec = timeout.count(), .tv_usec = 0};
    (void)::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    (void)::setsockopt(fd_.get(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    sockaddr_in own = address(from, 0);
    sockaddr_in other = address("127.0.0.1", port);
    connected_ = ::bind(fd_.get(), reinterpret_cast<sockaddr*>(&own), sizeof own) == 0 &&
                 ::connect(fd_.get(), reinterpret_cast<sockaddr*>(&other), sizeof other) == 0;
  }

  [[nodiscard]] bool connected() const { return connected_; }
  [[nodiscard]] int fd() const { return fd_.get(); }
  bool say(const std::string& text) const {
    return ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL) ==
           static_cast<ssize_t>(text.size());
  }
  /// Reads until `text` or the end of the connection; returns everything that was read.
  std::string hear_until(const std::string& text) {
    std::array<char, 16384> bytes{};
    size_t at = 0;
    while ((at = in_.find(text)) == std::string::npos) {
      const ssize_t got = ::recv(fd_.get(), bytes.data(), bytes.size(), 0);
      if (got <= 0) return std::exchange(in_, {});
      in_.append(bytes.data(), static_cast<size_t>(got));
    }
    std::string head = in_.substr(0, at + text.size());
    in_.erase(0, at + text.size());
    return head;
  }
  /// Reads one answer with a Content-Length.
  HttpAnswer answer(bool has_body = true) {
    HttpAnswer answer{.status = 0, .head = hear_until("\r\n\r\n"), .body = {}};
    if (!answer.head.starts_with("HTTP/1.1 ")) return answer;
    answer.status = number_from<int>(std::string_view(answer.head).substr(9, 3)).value_or(0);
    const size_t length = number_from<size_t>(answer.header("Content-Length")).value_or(0);
    std::array<char, 16384> bytes{};
    while (has_body && in_.size() < length) {
      const ssize_t got = ::recv(fd_.get(), bytes.data(), bytes.size(), 0);
      if (got <= 0) break;
      in_.append(bytes.data(), static_cast<size_t>(got));
    }
    if (has_body) answer.body = in_.substr(0, length);
    in_.erase(0, answer.body.size());
    return answer;
  }
  HttpAnswer ask(const std::string& method, const std::string& path,
                 const std::map<std::string, std::string>& headers = {},
                 const std::string& body = {}) {
    std::string text = method + " " + path + " HTTP/1.1\r\nHost: panel:8420\r\n";
    for (const auto& [name, value] : headers) text.append(name + ": " + value + "\r\n");
    if (!body.empty()) text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
    say(text + "\r\n" + body);
    return answer(method != "HEAD");
  }

 private:
  static sockaddr_in address(const std::string& host, uint16_t port) {
    sockaddr_in made{};
    made.sin_family = AF_INET;
    made.sin_port = htons(port);
    ::inet_pton(AF_INET, host.c_str(), &made.sin_addr);
    return made;
  }
  UniqueFd fd_;
  std::string in_;
  bool connected_ = false;
};

}  // namespace lenticule::test
