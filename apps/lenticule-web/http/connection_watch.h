// SPDX-License-Identifier: Apache-2.0
// ConnectionWatch ends connections that take too long. The HTTP library ends connections on which
// nothing moves; a client that sends one byte now and then would keep its connection forever.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <thread>

namespace lenticule::web {

/// Thread safety: any thread.
class ConnectionWatch {
 public:
  using Clock = std::chrono::steady_clock;

  /// When more than `crowded` connections are open, a new one ends the oldest that has not sent a
  /// permitted request.
  explicit ConnectionWatch(size_t crowded);
  ~ConnectionWatch();
  ConnectionWatch(const ConnectionWatch&) = delete;
  ConnectionWatch& operator=(const ConnectionWatch&) = delete;

  /// Begins to watch the connection; it ends unless another function extends its time.
  void opened(int fd, std::chrono::milliseconds time);
  /// Sets the time that the connection has from now on.
  void extend(int fd, std::chrono::milliseconds time);
  /// Removes the limit, for an answer that never ends.
  void release(int fd);
  /// Marks the connection as one of a known sender.
  void known(int fd);
  /// Must be called before the descriptor is closed.
  void closed(int fd);

  [[nodiscard]] size_t open() const;
  /// Returns the number of connections that were ended.
  [[nodiscard]] uint64_t ended() const;

 private:
  struct Entry {
    Clock::time_point deadline{};
    Clock::time_point since{};
    bool is_known = false;
    bool ended = false;
  };
  void work();
  void end(int fd, Entry& entry);
  void make_room();

  const size_t crowded_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<int, Entry> entries_;
  uint64_t ended_ = 0;
  bool stopping_ = false;
  std::thread thread_;  // last member
};

}  // namespace lenticule::web
