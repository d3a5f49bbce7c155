// SPDX-License-Identifier: Apache-2.0
// Server answers HTTP requests for a Site: it limits connections, sizes, times and rates, finds out
// who sent a request, and adds the headers that confine the pages.
//
// Each connection has a thread, so that a slow client delays only itself.
#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <microhttpd.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "apps/lenticule-web/http/access.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/http/parse.h"
#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "base/unix_address.h"
#include "frames/ring/listen_socket.h"

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

inline constexpr const char* kListenRemedy =
    "use a numeric address and a port: 127.0.0.1:8420 or [::1]:8420";
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
  throw usage_error("--listen: '{}' is not an address", address.host).remedy(kListenRemedy);
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
    throw failed_error("listen: {}", std::strerror(errno));
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
  throw usage_error("--listen: other machines can connect to {}", name)
      .remedy(
          "add --lan to permit this. Every machine of the network can then reach the pages, and "
          "without a reverse proxy with HTTPS the network can read the tokens");
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
    throw usage_error("--listen: '{}' is not an address with a port", text).remedy(kListenRemedy);
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
    throw failed_error("{}: {}", name, std::strerror(errno));
  if (wanted.family() == AF_INET6)
    (void)::setsockopt(fd.get(), IPPROTO_IPV6, IPV6_V6ONLY, &yes, sizeof yes);
  if (::bind(fd.get(), wanted.get(), wanted.bytes) != 0 || ::listen(fd.get(), kBacklog) != 0)
    throw device_error("{}: cannot listen: {}", name, std::strerror(errno))
        .remedy("choose another address: --listen ADDRESS:PORT");
  const SocketAddress bound = bound_address(fd.get());
  return {.fd = std::move(fd), .name = name_of(bound), .is_local = is_loopback(bound)};
}

/// Listens on a Unix socket with mode 0660; replaces the socket of a server that has exited.
[[nodiscard]] inline Listener listen_unix(const std::filesystem::path& path) {
  const UnixAddress address = unix_address(path);
  frames::clear_the_way(path, address);
  UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // The mode is set before the first connection is possible.
  if (!fd || ::fchmod(fd.get(), 0660) != 0 || ::bind(fd.get(), address.get(), address.bytes) != 0 ||
      ::chmod(path.c_str(), 0660) != 0 || ::listen(fd.get(), kBacklog) != 0)
    throw failed_error("{}: cannot listen: {}", path.string(), std::strerror(errno));
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

/// RateLimit counts events per address in token buckets.
///
/// Thread safety: any thread.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;

  /// Permits `burst` events at once and `per_second` on average, for each address.
  RateLimit(double burst, double per_second) : burst_(burst), per_second_(per_second) {}

  /// Counts one event; returns false, and counts nothing, if it is beyond the limit.
  [[nodiscard]] bool permits(const std::string& address, Clock::time_point now = Clock::now()) {
    const std::lock_guard lock(mutex_);
    auto found = buckets_.find(address);
    if (found == buckets_.end()) {
      if (buckets_.size() >= kMaxAddresses) forget_full(now);
      found = buckets_.emplace(address, Bucket{.tokens = burst_, .at = now}).first;
    }
    Bucket& bucket = found->second;
    bucket.tokens = tokens_of(bucket, now);
    bucket.at = now;
    if (bucket.tokens < 1.0) return false;
    bucket.tokens -= 1.0;
    return true;
  }
  /// Returns the number of addresses that are remembered; at most kMaxAddresses.
  [[nodiscard]] size_t addresses() const {
    const std::lock_guard lock(mutex_);
    return buckets_.size();
  }

  static constexpr size_t kMaxAddresses = 4096;

 private:
  struct Bucket {
    double tokens = 0.0;
    Clock::time_point at{};
  };
  [[nodiscard]] double tokens_of(const Bucket& bucket, Clock::time_point now) const {
    const double seconds = std::chrono::duration<double>(now - bucket.at).count();
    return std::min(burst_, bucket.tokens + seconds * per_second_);
  }
  /// Forgets the addresses whose bucket is full again; if that is not enough, all of them.
  void forget_full(Clock::time_point now) {
    std::erase_if(buckets_,
                  [&](const auto& entry) { return tokens_of(entry.second, now) >= burst_; });
    if (buckets_.size() >= kMaxAddresses) buckets_.clear();
  }

  const double burst_;
  const double per_second_;
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Bucket> buckets_;
};

/// ConnectionWatch ends connections that take too long, whose token was revoked, or that take the
/// room of others. The HTTP library ends connections on which nothing moves; a client that sends
/// one byte now and then would keep its connection forever.
///
/// Thread safety: any thread.
class ConnectionWatch {
 public:
  using Clock = std::chrono::steady_clock;

  /// When `crowded` connections are open, or `crowded_address` of one address, a new one ends the
  /// oldest of them that has not sent a permitted request. `is_valid` returns true if the token
  /// with that id was not revoked; it may take long.
  ConnectionWatch(size_t crowded, size_t crowded_address,
                  std::function<bool(const std::string& token_id)> is_valid)
      : crowded_(crowded),
        crowded_address_(crowded_address),
        is_valid_(std::move(is_valid)),
        thread_([this](const std::stop_token& stop) { work(stop); }) {}

  /// Begins to watch the connection; it ends unless another function extends its time. Connections
  /// without an address are not counted per address.
  void opened(int fd, const std::string& address, std::chrono::milliseconds time) {
    const std::lock_guard lock(mutex_);
    make_room(crowded_, {});
    const Clock::time_point now = Clock::now();
    entries_[fd] = {.deadline = now + time, .since = now, .address = address};
    // If all others are known, the new connection is the oldest unknown one, and ends.
    if (!address.empty()) make_room(crowded_address_ + 1, address);
  }
  /// Sets the time that the connection has from now on.
  void extend(int fd, std::chrono::milliseconds time) {
    change(fd, [&](Entry& entry) { entry.deadline = Clock::now() + time; });
  }
  /// Removes the limit, for an answer that never ends.
  void release(int fd) {
    change(fd, [](Entry& entry) { entry.deadline = Clock::time_point::max(); });
  }
  /// Marks the connection as one of a known sender; it ends when the token is revoked before the
  /// answer has ended.
  void known(int fd, const std::string& token_id) {
    change(fd, [&](Entry& entry) {
      entry.is_known = true;
      entry.token_id = token_id;
    });
  }
  /// Records the end of an answer. The connection ends without a new request within `time`.
  void answered(int fd, std::chrono::milliseconds time) {
    change(fd, [&](Entry& entry) {
      entry.deadline = Clock::now() + time;
      entry.token_id.clear();
    });
  }
  /// Must be called before the descriptor is closed.
  void closed(int fd) {
    const std::lock_guard lock(mutex_);
    entries_.erase(fd);
  }

  [[nodiscard]] size_t open() const {
    const std::lock_guard lock(mutex_);
    return entries_.size();
  }

 private:
  static constexpr auto kTick = std::chrono::milliseconds(200);

  struct Entry {
    Clock::time_point deadline{};
    Clock::time_point since{};
    std::string address{};
    std::string token_id{};  ///< token of the request that is being answered
    bool is_known = false;
    bool ended = false;
  };
  /// Changes the entry of a connection, if it is watched.
  void change(int fd, const auto& how) {
    const std::lock_guard lock(mutex_);
    if (const auto entry = entries_.find(fd); entry != entries_.end()) how(entry->second);
  }
  void work(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!ended_.wait_for(lock, stop, kTick, [&] { return stop.stop_requested(); })) {
      std::set<std::string> revoked;
      for (const auto& [fd, entry] : entries_)
        if (!entry.token_id.empty()) revoked.insert(entry.token_id);
      lock.unlock();  // a look into the file of tokens may take long, and holds up no connection
      std::erase_if(revoked, is_valid_);
      lock.lock();
      const Clock::time_point now = Clock::now();
      for (auto& [fd, entry] : entries_)
        if (entry.deadline <= now || revoked.contains(entry.token_id)) end(fd, entry);
    }
  }
  /// Shuts the socket down; the HTTP library then closes the connection. The descriptor is open,
  /// because closed() takes the lock before the library closes it.
  void end(int fd, Entry& entry) {
    if (entry.ended) return;
    entry.ended = true;
    (void)::shutdown(fd, SHUT_RDWR);
  }
  /// Ends the oldest unknown connection if `most` are open; an empty address stands for all
  /// addresses.
  void make_room(size_t most, const std::string& address) {
    size_t live = 0;
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (entry->second.ended || (!address.empty() && entry->second.address != address)) continue;
      ++live;
      if (entry->second.is_known) continue;
      if (oldest == entries_.end() || entry->second.since < oldest->second.since) oldest = entry;
    }
    if (live >= most && oldest != entries_.end()) end(oldest->first, oldest->second);
  }

  const size_t crowded_;
  const size_t crowded_address_;
  const std::function<bool(const std::string& token_id)> is_valid_;
  mutable std::mutex mutex_;
  std::condition_variable_any ended_;
  std::map<int, Entry> entries_;
  std::jthread thread_;  // last member: the thread uses everything above
};

struct ServerLimits {
  unsigned connections = 400;
  unsigned connections_per_address = 32;
  /// Time for the first line and the headers of a request, and between two requests.
  std::chrono::milliseconds head_time = std::chrono::seconds(10);
  /// Time without any byte after which a connection ends.
  std::chrono::seconds idle_time{20};
  /// A body must arrive at this rate, after `head_time`.
  uint64_t slowest_bytes_per_s = 16u << 10;
  std::chrono::milliseconds answer_time = std::chrono::seconds(60);
  size_t head_bytes = 16u << 10;
  double requests_burst = 200;
  double requests_per_s = 40;
  double wrong_tokens_burst = 10;
  double wrong_tokens_per_s = 0.1;
  unsigned streams = 32;
};

class Server {
 public:
  /// Begins to listen. Throws Error(Failed). Lifetime: `site`, `access` and `clock` must outlive
  /// the server. `clock` counts for the rates of requests; connections have the machine's time.
  Server(std::vector<Listener> listeners, Site& site, Access& access, ServerLimits limits = {},
         Clock& clock = machine_clock())
      : site_(site),
        access_(access),
        limits_(limits),
        clock_(clock),
        requests_(limits.requests_burst, limits.requests_per_s),
        wrong_tokens_(limits.wrong_tokens_burst, limits.wrong_tokens_per_s),
        watch_(limits.connections * 3 / 4, limits.connections_per_address,
               [&access](const std::string& token_id) { return access.is_valid(token_id); }) {
    for (Listener& listener : listeners) {
      auto door = std::make_unique<Door>(
          Door{.server = this, .listener = std::move(listener), .daemon = nullptr});
      // The library closes its socket itself.
      const int listening = ::fcntl(door->listener.fd.get(), F_DUPFD_CLOEXEC, 0);
      door->daemon = MHD_start_daemon(
          MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_THREAD_PER_CONNECTION | MHD_USE_POLL |
              MHD_USE_ITC | MHD_USE_ERROR_LOG,
          0, nullptr, nullptr, &ServerCallbacks::handle, door.get(),
          // The first option, so that it receives messages about the others.
          MHD_OPTION_EXTERNAL_LOGGER, &ServerCallbacks::discard_message, nullptr,
          MHD_OPTION_LISTEN_SOCKET, listening, MHD_OPTION_CONNECTION_LIMIT, limits.connections,
          // The watch ends connections a little later: other addresses have room meanwhile.
          MHD_OPTION_PER_IP_CONNECTION_LIMIT, limits.connections / 2, MHD_OPTION_CONNECTION_TIMEOUT,
          static_cast<unsigned>(limits.idle_time.count()), MHD_OPTION_CONNECTION_MEMORY_LIMIT,
          limits.head_bytes, MHD_OPTION_THREAD_STACK_SIZE, kThreadStack,
          MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_UNESCAPE_CALLBACK, &ServerCallbacks::unescape,
          nullptr, MHD_OPTION_NOTIFY_COMPLETED, &ServerCallbacks::completed, door.get(),
          MHD_OPTION_NOTIFY_CONNECTION, &ServerCallbacks::connection_changed, door.get(),
          MHD_OPTION_END);
      if (door->daemon == nullptr)
        throw failed_error("{}: the HTTP server cannot be started", door->listener.name);
      doors_.push_back(std::move(door));
    }
  }
  /// Ends all connections.
  ~Server() {
    for (const auto& door : doors_) MHD_stop_daemon(door->daemon);
  }

  [[nodiscard]] size_t connections() const { return watch_.open(); }

 private:
  static constexpr const char* kCookie = "lenticule";

  static constexpr size_t kThreadStack = size_t{1} << 20;
  static constexpr auto kCookieDays = 90;

  /// Sent with every answer. Pages get scripts, styles and data from this server only, and no other
  /// site may embed or read them.
  static constexpr std::array<std::pair<const char*, const char*>, 6> kHeaders = {{
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
       "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
      {"Permissions-Policy", "camera=(), microphone=(), geolocation=()"},
  }};

  static std::optional<std::string> text_or_none(const char* text) {
    return text == nullptr ? std::nullopt : std::optional<std::string>(text);
  }

  static int fd_of(MHD_Connection* connection) {
    const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    return info == nullptr ? -1 : info->connect_fd;
  }

  /// Returns the network that counts as one sender: an IPv4 address, or 64 bits of an IPv6 address,
  /// of which every host has 2^64.
  static std::string sender_of(const sockaddr& address) {
    if (address.sa_family != AF_INET6) return host_of(address);
    sockaddr_in6 network = reinterpret_cast<const sockaddr_in6&>(address);
    std::memset(&network.sin6_addr.s6_addr[8], 0, 8);
    return host_of(reinterpret_cast<const sockaddr&>(network));
  }

  static std::string address_of(MHD_Connection* connection) {
    const auto* const info =
        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
    const bool is_known = info != nullptr && info->client_addr != nullptr;
    return is_known ? sender_of(*info->client_addr) : std::string();
  }

  /// Returns true if the request states the length of its body twice. A proxy in front could
  /// believe the other length, and take the rest of the body for another client's request.
  static bool has_two_lengths(MHD_Connection* connection) {
    int lengths = 0;
    const auto count = [](void* found, enum MHD_ValueKind, const char* name, const char*) {
      const std::string header = lower_case(name);
      if (header == "content-length" || header == "transfer-encoding") ++*static_cast<int*>(found);
      return MHD_YES;
    };
    (void)MHD_get_connection_values(connection, MHD_HEADER_KIND, count, &lengths);
    return lengths > 1;
  }

  /// Returns the last address of X-Forwarded-For, which the reverse proxy itself has added.
  static std::string forwarded_sender(MHD_Connection* connection) {
    const auto header =
        text_or_none(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "X-Forwarded-For"));
    if (!header) return "proxy";
    std::string_view list = *header;
    std::string_view last;
    while (!list.empty()) last = take_until(list, ',');
    return std::string(without_blanks(last).substr(0, 45));
  }

  /// Returns true if a page of another site cannot have sent the request: browsers state the origin
  /// of each request that changes something, and send the cookie to the same site only.
  static bool is_own_origin(const Request& request) {
    if (const auto site = request.header("Sec-Fetch-Site");
        site && *site != "same-origin" && *site != "none")
      return false;
    const auto origin = request.header("Origin");
    if (!origin) return true;
    const auto host = request.header("Host");
    const size_t slashes = origin->find("://");
    return host && slashes != std::string::npos && origin->substr(slashes + 3) == *host;
  }

  static Response html_page(int status, const std::string& title, const std::string& content,
                            const std::string& head = {}) {
    Response response;
    response.status = status;
    response.type = "text/html; charset=utf-8";
    response.body = fmt::format(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">{}"
        "<title>{}</title><link rel=\"icon\" href=\"/icon.svg\"><link rel=\"stylesheet\" "
        "href=\"/style.css\"></head>"
        "<body><main><h1>{}</h1>{}</main></body></html>\n",
        head, title, title, content);
    return response;
  }

  [[noreturn]] static void refuse_body(uint64_t largest) {
    throw HttpError(413, fmt::format("the body has more than {} bytes", largest));
  }

  /// Call is one request, from its headers to the end of its answer.
  struct Call {
    Request request;
    std::unique_ptr<BodySink> sink;
    std::optional<Response> refusal;
    uint64_t largest_body = 0;
    uint64_t received = 0;
    int fd = -1;
    bool by_cookie = false;
    bool wrong_credential = false;
  };

  struct Door {
    Server* server = nullptr;
    Listener listener;
    MHD_Daemon* daemon = nullptr;
  };

  /// The functions that the HTTP library calls.
  struct ServerCallbacks {
    static enum MHD_Result handle(void* door, MHD_Connection* connection, const char* url,
                                  const char* method, const char* /*version*/, const char* data,
                                  size_t* size, void** state) {
      auto& own = *static_cast<Door*>(door);
      try {
        const int result = own.server->handle(own, connection, url, method, data, size, state);
        return result != 0 ? MHD_YES : MHD_NO;
      } catch (const std::exception& error) {
        say("web: {}\n", error.what());
        return MHD_NO;
      }
    }

    static void completed(void* door, MHD_Connection* connection, void** state,
                          enum MHD_RequestTerminationCode /*code*/) {
      auto& server = *static_cast<Door*>(door)->server;
      delete static_cast<Call*>(std::exchange(*state, nullptr));
      server.watch_.answered(fd_of(connection), server.limits_.head_time);
    }

    static void connection_changed(void* door, MHD_Connection* connection, void** /*state*/,
                                   enum MHD_ConnectionNotificationCode code) {
      const auto& own = *static_cast<Door*>(door);
      auto& server = *own.server;
      if (code == MHD_CONNECTION_NOTIFY_STARTED)
        server.watch_.opened(fd_of(connection),
                             own.listener.is_unix ? std::string() : address_of(connection),
                             server.limits_.head_time);
      else
        server.watch_.closed(fd_of(connection));
    }

    /// Decodes an address or a part of its query. A text with an encoded zero stays as it is: its
    /// end would be cut off, and the rest would name something else.
    static size_t unescape(void* /*unused*/, MHD_Connection* /*connection*/, char* text) {
      return std::strstr(text, "%00") != nullptr ? std::strlen(text) : MHD_http_unescape(text);
    }

    /// Discards the library's messages, which strangers can cause at will.
    static void discard_message(void* /*unused*/, const char* /*format*/, va_list /*arguments*/) {}

    /// StreamState is an answer that continues, and the text that is not sent yet.
    struct StreamState {
      EventStream events;
      std::string text;
      std::atomic<unsigned>* streams = nullptr;  ///< number of such answers
    };

    static ssize_t read_stream(void* state, uint64_t /*position*/, char* buffer, size_t size) {
      auto& stream = *static_cast<StreamState*>(state);
      try {
        if (stream.text.empty()) {
          auto next = stream.events();
          if (!next) return MHD_CONTENT_READER_END_OF_STREAM;
          stream.text = std::move(*next);
        }
      } catch (const std::exception& error) {
        say("web: {}\n", error.what());
        return MHD_CONTENT_READER_END_WITH_ERROR;
      }
      const size_t bytes = std::min(size, stream.text.size());
      std::memcpy(buffer, stream.text.data(), bytes);
      stream.text.erase(0, bytes);
      return static_cast<ssize_t>(bytes);
    }
    static void free_stream(void* state) {
      const std::unique_ptr<StreamState> owned(static_cast<StreamState*>(state));
      owned->streams->fetch_sub(1);
    }
  };

  [[nodiscard]] int handle(Door& door, MHD_Connection* connection, const char* url,
                           const char* method, const char* data, size_t* size, void** state) {
    if (*state == nullptr) return begin(door, connection, url, method, state);
    Call& call = *static_cast<Call*>(*state);
    if (*size == 0) return finish(connection, call);
    call.received += *size;
    if (!call.refusal) {
      try {
        // A body in chunks comes without a length.
        if (call.received > call.largest_body) refuse_body(call.largest_body);
        if (call.sink)
          call.sink->take({reinterpret_cast<const uint8_t*>(data), *size});
        else
          call.request.body.append(data, *size);
      } catch (const Error& error) {
        call.refusal = error_response(error);
        call.sink.reset();
      }
    }
    *size = 0;
    return MHD_YES;
  }
  /// Decides after the headers whether the request may have a body, and where it goes.
  [[nodiscard]] int begin(Door& door, MHD_Connection* connection, const char* url,
                          const char* method, void** state) {
    auto owned = std::make_unique<Call>();
    Call& call = *owned;
    *state = owned.release();
    call.fd = fd_of(connection);
    Request& request = call.request;
    request.method = method;
    request.path = url;
    request.query = [connection](const char* name) {
      return text_or_none(MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, name));
    };
    request.header = [connection](const char* name) {
      return text_or_none(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name));
    };
    request.peer = door.listener.is_unix ? forwarded_sender(connection) : address_of(connection);
    uint64_t length = 0;
    try {
      identify(call);
      // Each token has a rate of its own, so that others of the same network do not use it up.
      if (!requests_.permits(request.peer + " " + request.sender.token_id, clock_.now()))
        throw HttpError(429, "too many requests from this address", "wait some seconds");
      if (call.wrong_credential) count_wrong_token(request.peer);
      if (has_two_lengths(connection))
        throw HttpError(400, "the request states two lengths of its body",
                        "send one Content-Length, or one Transfer-Encoding");
      if (const auto text = request.header("Content-Length"))
        length = number_from<uint64_t>(*text).value_or(UINT64_MAX);
      call.largest_body = site_.largest_body(request.method, request.path);
      if (length > call.largest_body) refuse_body(call.largest_body);
      require_rights(call);
      call.sink = site_.sink(request);
    } catch (const Error& error) {
      return send(connection, call, error_response(error));
    }
    const auto body_time = std::chrono::seconds(length / limits_.slowest_bytes_per_s);
    watch_.extend(call.fd, limits_.head_time + body_time);
    return MHD_YES;
  }
  [[nodiscard]] int finish(MHD_Connection* connection, Call& call) {
    watch_.extend(call.fd, limits_.answer_time);
    return send(connection, call, response_of(call));
  }
  [[nodiscard]] Response response_of(Call& call) {
    if (call.refusal) return std::move(*call.refusal);
    // A quarter of the time is for what cannot be interrupted, and for sending the answer.
    const AnswerTime time(limits_.answer_time * 3 / 4);
    try {
      if (call.request.path == "/enter") {
        if (call.request.method != "GET") throw HttpError(405, "only GET is possible here");
        return enter(call.request);
      }
      // The sink ends before the answer is sent, so a client can send its next part at once.
      const std::unique_ptr<BodySink> sink = std::move(call.sink);
      return sink ? sink->finish() : site_.answer(call.request);
    } catch (const Error& error) {
      return error_response(error);
    } catch (const std::exception& error) {
      say("web: {} {}: {}\n", call.request.method, call.request.path, error.what());
      return error_response(500, "the server failed; its log has the reason");
    }
  }
  /// Counts a wrong token. Throws HttpError 429 if its sender sent too many before. A right token
  /// is never refused for wrong ones: others of the same network could keep its owner out.
  void count_wrong_token(const std::string& peer) {
    if (!wrong_tokens_.permits(peer, clock_.now()))
      throw HttpError(429, "too many wrong tokens from this address", "wait a minute");
  }
  /// Finds out who sent the request.
  void identify(Call& call) {
    Request& request = call.request;
    if (request.path == "/enter") return;  // has a token of its own
    if (const auto authorization = request.header("Authorization")) {
      if (const auto credential = bearer_credential(*authorization))
        request.sender = access_.with_token(*credential);
      call.wrong_credential = request.sender.rights == Rights::None;
    } else if (const auto cookies = request.header("Cookie")) {
      if (const auto value = cookie_value(*cookies, kCookie)) {
        request.sender = access_.with_cookie(*value);
        call.by_cookie = true;
        call.wrong_credential = request.sender.rights == Rights::None;
      }
    }
    if (request.sender.rights != Rights::None) watch_.known(call.fd, request.sender.token_id);
  }
  void require_rights(Call& call) const {
    const Request& request = call.request;
    if (request.path == "/enter") return;
    const Rights needed = site_.needed(request.method, request.path);
    if (needed == Rights::None) return;
    if (request.sender.rights == Rights::None)
      throw HttpError(
          401, call.wrong_credential ? "the token is not valid any more" : "no token was sent",
          "open the address with the token again");
    if (static_cast<int>(request.sender.rights) < static_cast<int>(needed))
      throw HttpError(403, "this token may see, not change", "use a token with the right 'change'");
    const bool reads = request.method == "GET" || request.method == "HEAD";
    if (!reads && call.by_cookie && !is_own_origin(request))
      throw HttpError(403, "the request comes from a page of another site");
  }
  /// Exchanges the token of the address for a cookie. The answer is a page that leads on, instead
  /// of a redirection, because a browser that follows a link of another site would not send the
  /// cookie to the next page.
  [[nodiscard]] Response enter(const Request& request) {
    const std::string token = request.query("token").value_or("");
    const std::string cookie =
        access_.with_token(token).rights == Rights::None ? std::string() : access_.cookie_of(token);
    if (cookie.empty()) {
      count_wrong_token(request.peer);
      return html_page(401, "This address is not valid",
                       "<p>Its token is wrong or was revoked. Ask for a new address: "
                       "<code>lenticule web token add NAME</code>.</p>");
    }
    Response response = html_page(200, "Welcome", "<p><a href=\"/\">Continue</a></p>",
                                  "<meta http-equiv=\"refresh\" content=\"0; url=/\">");
    const bool is_https = request.header("X-Forwarded-Proto").value_or("") == "https";
    response.headers.emplace_back(
        "Set-Cookie", fmt::format("{}={}; Path=/; Max-Age={}; HttpOnly; SameSite=Strict{}", kCookie,
                                  cookie, kCookieDays * 86400, is_https ? "; Secure" : ""));
    return response;
  }
  [[nodiscard]] int send(MHD_Connection* connection, Call& call, Response response) {
    const bool page_wanted =
        response.status == 401 && response.type == "application/json" &&
        call.request.header("Accept").value_or("").find("text/html") != std::string::npos;
    if (page_wanted)
      response = html_page(401, "This page needs its address with a token",
                           "<p>Scan the code on the panel, or open the address that "
                           "<code>lenticule web address</code> prints.</p>");
    if (response.status == 429) response.headers.emplace_back("Retry-After", "10");
    if (response.status == 401) response.headers.emplace_back("WWW-Authenticate", "Bearer");

    MHD_Response* made = nullptr;
    if (response.events && streams_.fetch_add(1) >= limits_.streams) {
      streams_.fetch_sub(1);
      response = error_response(503, "too many pages are open", "close one of them");
    }
    if (response.events) {
      watch_.release(call.fd);
      auto* const state = new ServerCallbacks::StreamState{
          .events = std::move(response.events), .text = {}, .streams = &streams_};
      made =
          MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 4096, &ServerCallbacks::read_stream,
                                            state, &ServerCallbacks::free_stream);
      if (made == nullptr) ServerCallbacks::free_stream(state);
    } else if (!response.borrowed.empty()) {
      made = MHD_create_response_from_buffer(response.borrowed.size(),
                                             const_cast<char*>(response.borrowed.data()),
                                             MHD_RESPMEM_PERSISTENT);
    } else {
      made = MHD_create_response_from_buffer(response.body.size(), response.body.data(),
                                             MHD_RESPMEM_MUST_COPY);
    }
    if (made == nullptr) return MHD_NO;
    for (const auto& [name, value] : kHeaders) (void)MHD_add_response_header(made, name, value);
    (void)MHD_add_response_header(made, "Content-Type", response.type.c_str());
    bool has_cache_rule = false;
    for (const auto& [name, value] : response.headers) {
      (void)MHD_add_response_header(made, name.c_str(), value.c_str());
      has_cache_rule = has_cache_rule || name == "Cache-Control";
    }
    if (!has_cache_rule) (void)MHD_add_response_header(made, "Cache-Control", "no-store");
    const int result = MHD_queue_response(connection, static_cast<unsigned>(response.status), made);
    MHD_destroy_response(made);
    return result;
  }

  Site& site_;
  Access& access_;
  const ServerLimits limits_;
  Clock& clock_;
  RateLimit requests_;
  RateLimit wrong_tokens_;
  ConnectionWatch watch_;
  std::atomic<unsigned> streams_{0};
  std::vector<std::unique_ptr<Door>> doors_;  // last member: their threads use all above
};

}  // namespace lenticule::web
