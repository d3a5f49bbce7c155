// SPDX-License-Identifier: Apache-2.0
// Opens the sockets on which the server listens: TCP, Unix, or passed by the service manager.
#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/numbers.h"
#include "base/unique_fd.h"
#include "base/unix_address.h"

namespace lenticule::web {

struct Listener {
  UniqueFd fd;
  std::string name;       ///< "127.0.0.1:8420" or the path of the socket
  bool is_unix = false;   ///< requests come from a reverse proxy of this machine
  bool is_local = false;  ///< only this machine can connect
};

/// Address to listen on. Names are not looked up.
struct ListenAddress {
  std::string host;  ///< numeric, without brackets
  uint16_t port = 0;
};

inline constexpr int kBacklog = 256;
inline constexpr int kFirstPassed = 3;  // SD_LISTEN_FDS_START

/// SocketAddress is a numeric address of one of the two families, or of a Unix socket.
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t bytes = 0;

  [[nodiscard]] int family() const { return storage.ss_family; }
  [[nodiscard]] sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
  [[nodiscard]] const sockaddr_in& v4() const {
    return *reinterpret_cast<const sockaddr_in*>(get());
  }
  [[nodiscard]] const sockaddr_in6& v6() const {
    return *reinterpret_cast<const sockaddr_in6*>(get());
  }
};

[[noreturn]] inline void fail(ErrorKind kind, const std::string& name, const std::string& cause,
                              const std::string& remedy = {}) {
  throw Error(kind, name + ": " + cause, remedy);
}

inline SocketAddress numeric_address(const ListenAddress& address) {
  SocketAddress made;
  if (auto* const v4 = reinterpret_cast<sockaddr_in*>(&made.storage);
      ::inet_pton(AF_INET, address.host.c_str(), &v4->sin_addr) == 1) {
    v4->sin_family = AF_INET;
    v4->sin_port = htons(address.port);
    made.bytes = sizeof *v4;
    return made;
  }
  if (auto* const v6 = reinterpret_cast<sockaddr_in6*>(&made.storage);
      ::inet_pton(AF_INET6, address.host.c_str(), &v6->sin6_addr) == 1) {
    v6->sin6_family = AF_INET6;
    v6->sin6_port = htons(address.port);
    made.bytes = sizeof *v6;
    return made;
  }
  fail(ErrorKind::Usage, "--listen", fmt::format("'{}' is not an address", address.host),
       "use a numeric address and a port: 127.0.0.1:8420 or [::1]:8420");
}

inline bool is_loopback(const SocketAddress& address) {
  if (address.family() == AF_INET) return (ntohl(address.v4().sin_addr.s_addr) >> 24) == 127;
  if (address.family() == AF_INET6) return IN6_IS_ADDR_LOOPBACK(&address.v6().sin6_addr) != 0;
  return address.family() == AF_UNIX;
}

inline SocketAddress bound_address(int fd) {
  SocketAddress address;
  address.bytes = sizeof address.storage;
  if (::getsockname(fd, address.get(), &address.bytes) != 0)
    fail(ErrorKind::Failed, "listen", std::strerror(errno));
  return address;
}

/// Returns the host of an internet address: "127.0.0.1" or "[::1]"; empty for another family.
inline std::string host_of(const sockaddr& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (address.sa_family == AF_INET)
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in&>(address).sin_addr, text.data(),
                text.size());
  if (address.sa_family != AF_INET6) return text.data();
  ::inet_ntop(AF_INET6, &reinterpret_cast<const sockaddr_in6&>(address).sin6_addr, text.data(),
              text.size());
  return fmt::format("[{}]", text.data());
}

/// Returns the name of a host with the port of `bound`; both families have it at the same place.
inline std::string with_port(const std::string& host, const SocketAddress& bound) {
  return fmt::format("{}:{}", host, ntohs(bound.v4().sin_port));
}

inline std::string name_of(const SocketAddress& address) {
  if (address.family() == AF_UNIX)
    return reinterpret_cast<const sockaddr_un&>(address.storage).sun_path;
  return with_port(host_of(*address.get()), address);
}

inline void require_lan(const std::string& name, bool is_local, bool lan) {
  if (is_local || lan) return;
  fail(ErrorKind::Usage, "--listen", fmt::format("other machines can connect to {}", name),
       "add --lan to permit this. Every machine of the network can then reach the pages, and "
       "without a reverse proxy with HTTPS the network can read the tokens");
}

/// Removes the socket of a server that has exited.
inline void remove_dead_socket(const std::filesystem::path& path, const UnixAddress& address) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode))
    fail(ErrorKind::Usage, path.string(), "exists and is not a socket");
  const UniqueFd probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!probe) fail(ErrorKind::Failed, path.string(), std::strerror(errno));
  if (::connect(probe.get(), address.get(), address.bytes) == 0 || errno != ECONNREFUSED)
    fail(ErrorKind::Device, path.string(), "another server listens there",
         "stop that server, or use another socket");
  (void)::unlink(path.c_str());
}

inline bool is_any(const SocketAddress& address) {
  if (address.family() == AF_INET) return address.v4().sin_addr.s_addr == INADDR_ANY;
  return address.family() == AF_INET6 && IN6_IS_ADDR_UNSPECIFIED(&address.v6().sin6_addr) != 0;
}

/// Returns false for addresses that need the name of an interface (fe80::...).
inline bool is_plain(const sockaddr& address) {
  return address.sa_family != AF_INET6 ||
         IN6_IS_ADDR_LINKLOCAL(&reinterpret_cast<const sockaddr_in6&>(address).sin6_addr) == 0;
}

/// Returns the addresses by which clients reach the listener: for one that accepts connections at
/// every address of the machine, those of its network interfaces.
[[nodiscard]] inline std::vector<std::string> reachable_names(const Listener& listener) {
  const SocketAddress bound = bound_address(listener.fd.get());
  ifaddrs* first = nullptr;
  if (!is_any(bound) || ::getifaddrs(&first) != 0) return {listener.name};
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owned(first, &::freeifaddrs);
  std::vector<std::string> names;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    const bool is_up = (one->ifa_flags & IFF_UP) != 0 && (one->ifa_flags & IFF_LOOPBACK) == 0;
    if (is_up && one->ifa_addr != nullptr && one->ifa_addr->sa_family == bound.family() &&
        is_plain(*one->ifa_addr))
      names.push_back(with_port(host_of(*one->ifa_addr), bound));
  }
  if (names.empty()) names.push_back(listener.name);
  return names;
}

/// Parses "127.0.0.1:8420" or "[::1]:8420". Throws Error(Usage).
[[nodiscard]] inline ListenAddress parse_listen_address(const std::string& text) {
  const size_t colon = text.rfind(':');
  std::string host = colon == std::string::npos ? "" : text.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']')
    host = host.substr(1, host.size() - 2);
  else if (host.find(':') != std::string::npos)
    host.clear();  // an IPv6 address without brackets: the port is ambiguous
  const auto port = colon == std::string::npos
                        ? std::nullopt
                        : number_from<uint16_t>(std::string_view(text).substr(colon + 1));
  if (host.empty() || !port)
    fail(ErrorKind::Usage, "--listen", fmt::format("'{}' is not an address with a port", text),
         "use a numeric address and a port: 127.0.0.1:8420 or [::1]:8420");
  ListenAddress address{.host = host, .port = *port};
  (void)numeric_address(address);
  return address;
}

/// Listens on an address. Throws Error(Usage) if other machines could connect and `lan` is false,
/// Error(Device) if the address is taken.
[[nodiscard]] inline Listener listen_tcp(const ListenAddress& address, bool lan) {
  const SocketAddress wanted = numeric_address(address);
  const std::string name = name_of(wanted);
  require_lan(name, is_loopback(wanted), lan);
  UniqueFd fd(::socket(wanted.family(), SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int yes = 1;
  if (!fd || ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0)
    fail(ErrorKind::Failed, name, std::strerror(errno));
  if (wanted.family() == AF_INET6)
    (void)::setsockopt(fd.get(), IPPROTO_IPV6, IPV6_V6ONLY, &yes, sizeof yes);
  if (::bind(fd.get(), wanted.get(), wanted.bytes) != 0 || ::listen(fd.get(), kBacklog) != 0)
    fail(ErrorKind::Device, name, fmt::format("cannot listen: {}", std::strerror(errno)),
         "choose another address: --listen ADDRESS:PORT");
  const SocketAddress bound = bound_address(fd.get());
  return {.fd = std::move(fd), .name = name_of(bound), .is_local = is_loopback(bound)};
}

/// Listens on a Unix socket with mode 0660; replaces the socket of a server that has exited.
[[nodiscard]] inline Listener listen_unix(const std::filesystem::path& path) {
  const UnixAddress address = unix_address(path);
  remove_dead_socket(path, address);
  UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // The mode is set before the first connection is possible.
  if (!fd || ::fchmod(fd.get(), 0660) != 0 || ::bind(fd.get(), address.get(), address.bytes) != 0 ||
      ::chmod(path.c_str(), 0660) != 0 || ::listen(fd.get(), kBacklog) != 0)
    fail(ErrorKind::Failed, path.string(), fmt::format("cannot listen: {}", std::strerror(errno)));
  return {.fd = std::move(fd), .name = path.string(), .is_unix = true, .is_local = true};
}

/// Returns the sockets that the service manager passed; empty if there are none. Throws
/// Error(Usage) if other machines could connect to one and `lan` is false.
[[nodiscard]] inline std::vector<Listener> passed_listeners(bool lan) {
  const auto number = [](const char* variable) -> std::optional<int> {
    const char* const text = std::getenv(variable);
    return text == nullptr ? std::nullopt : number_from<int>(text);
  };
  std::vector<Listener> listeners;
  if (number("LISTEN_PID") != static_cast<int>(::getpid())) return listeners;
  const int count = number("LISTEN_FDS").value_or(0);
  for (int fd = kFirstPassed; fd < kFirstPassed + count; ++fd) {
    UniqueFd owned(fd);
    (void)::fcntl(fd, F_SETFD, FD_CLOEXEC);
    (void)::fcntl(fd, F_SETFL, O_NONBLOCK);
    const SocketAddress bound = bound_address(fd);
    const std::string name = name_of(bound);
    require_lan(name, is_loopback(bound), lan);
    listeners.push_back({.fd = std::move(owned),
                         .name = name,
                         .is_unix = bound.family() == AF_UNIX,
                         .is_local = is_loopback(bound)});
  }
  return listeners;
}

}  // namespace lenticule::web
