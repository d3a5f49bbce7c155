// SPDX-License-Identifier: Apache-2.0
// RateLimit and ConnectionWatch bound what strangers can take from the server: requests, and
// connections.
#pragma once

#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <unordered_map>
#include <utility>

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
      : crowded_(crowded), crowded_address_(crowded_address), is_valid_(std::move(is_valid)) {
    thread_ = std::thread([this] { work(); });
  }
  ~ConnectionWatch() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  ConnectionWatch(const ConnectionWatch&) = delete;
  ConnectionWatch& operator=(const ConnectionWatch&) = delete;

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
  void work() {
    std::unique_lock lock(mutex_);
    while (!stopping_) {
      changed_.wait_for(lock, kTick, [this] { return stopping_; });
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
  std::condition_variable changed_;
  std::map<int, Entry> entries_;
  bool stopping_ = false;
  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::web
