// SPDX-License-Identifier: Apache-2.0
// RateLimit and ConnectionWatch bound what strangers can take from the server: requests, and
// connections.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>

namespace lenticule::web {

/// RateLimit counts events per address in token buckets.
///
/// Thread safety: any thread.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;

  /// Permits `burst` events at once and `per_second` on average, for each address.
  RateLimit(double burst, double per_second) : burst_(burst), per_second_(per_second) {}

  /// Counts one event; returns false, and counts nothing, if it is beyond the limit.
  [[nodiscard]] bool permits(const std::string& address, Clock::time_point now = Clock::now());
  /// Returns the number of addresses that are remembered; at most kMaxAddresses.
  [[nodiscard]] size_t addresses() const;

  static constexpr size_t kMaxAddresses = 4096;

 private:
  struct Bucket {
    double tokens = 0.0;
    Clock::time_point at{};
  };
  [[nodiscard]] double tokens_of(const Bucket& bucket, Clock::time_point now) const;
  void forget_full(Clock::time_point now);

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
                  std::function<bool(const std::string& token_id)> is_valid);
  ~ConnectionWatch();
  ConnectionWatch(const ConnectionWatch&) = delete;
  ConnectionWatch& operator=(const ConnectionWatch&) = delete;

  /// Begins to watch the connection; it ends unless another function extends its time. Connections
  /// without an address are not counted per address.
  void opened(int fd, const std::string& address, std::chrono::milliseconds time);
  /// Sets the time that the connection has from now on.
  void extend(int fd, std::chrono::milliseconds time);
  /// Removes the limit, for an answer that never ends.
  void release(int fd);
  /// Marks the connection as one of a known sender; it ends when the token is revoked before the
  /// answer has ended.
  void known(int fd, const std::string& token_id);
  /// Records the end of an answer. The connection ends without a new request within `time`.
  void answered(int fd, std::chrono::milliseconds time);
  /// Must be called before the descriptor is closed.
  void closed(int fd);

  [[nodiscard]] size_t open() const;

 private:
  struct Entry {
    Clock::time_point deadline{};
    Clock::time_point since{};
    std::string address{};
    std::string token_id{};  ///< token of the request that is being answered
    bool is_known = false;
    bool ended = false;
  };
  void work();
  void end(int fd, Entry& entry);
  void make_room(size_t most, const std::string& address);

  const size_t crowded_;
  const size_t crowded_address_;
  const std::function<bool(const std::string& token_id)> is_valid_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<int, Entry> entries_;
  bool stopping_ = false;
  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::web
