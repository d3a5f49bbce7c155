// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/limits.h"

#include <sys/socket.h>

#include <algorithm>
#include <set>
#include <utility>

namespace lenticule::web {
namespace {

constexpr auto kTick = std::chrono::milliseconds(200);

}  // namespace

double RateLimit::tokens_of(const Bucket& bucket, Clock::time_point now) const {
  const double seconds = std::chrono::duration<double>(now - bucket.at).count();
  return std::min(burst_, bucket.tokens + seconds * per_second_);
}

/// Forgets the addresses whose bucket is full again; if that is not enough, all of them.
void RateLimit::forget_full(Clock::time_point now) {
  std::erase_if(buckets_,
                [&](const auto& entry) { return tokens_of(entry.second, now) >= burst_; });
  if (buckets_.size() >= kMaxAddresses) buckets_.clear();
}

bool RateLimit::permits(const std::string& address, Clock::time_point now) {
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

size_t RateLimit::addresses() const {
  const std::lock_guard lock(mutex_);
  return buckets_.size();
}

// --- connections ----------------------------------------------------------------------------

ConnectionWatch::ConnectionWatch(size_t crowded, size_t crowded_address,
                                 std::function<bool(const std::string& token_id)> is_valid)
    : crowded_(crowded), crowded_address_(crowded_address), is_valid_(std::move(is_valid)) {
  thread_ = std::thread([this] { work(); });
}

ConnectionWatch::~ConnectionWatch() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

/// Shuts the socket down; the HTTP library then closes the connection. The descriptor is open,
/// because closed() takes the lock before the library closes it.
void ConnectionWatch::end(int fd, Entry& entry) {
  if (entry.ended) return;
  entry.ended = true;
  (void)::shutdown(fd, SHUT_RDWR);
}

/// Ends the oldest unknown connection if `most` are open; an empty address stands for all
/// addresses.
void ConnectionWatch::make_room(size_t most, const std::string& address) {
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

void ConnectionWatch::opened(int fd, const std::string& address, std::chrono::milliseconds time) {
  const std::lock_guard lock(mutex_);
  make_room(crowded_, {});
  const Clock::time_point now = Clock::now();
  entries_[fd] = {.deadline = now + time, .since = now, .address = address};
  // If all others are known, the new connection is the oldest unknown one, and ends.
  if (!address.empty()) make_room(crowded_address_ + 1, address);
}

void ConnectionWatch::extend(int fd, std::chrono::milliseconds time) {
  const std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(fd); entry != entries_.end())
    entry->second.deadline = Clock::now() + time;
}

void ConnectionWatch::release(int fd) {
  const std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(fd); entry != entries_.end())
    entry->second.deadline = Clock::time_point::max();
}

void ConnectionWatch::known(int fd, const std::string& token_id) {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(fd);
  if (entry == entries_.end()) return;
  entry->second.is_known = true;
  entry->second.token_id = token_id;
}

void ConnectionWatch::answered(int fd, std::chrono::milliseconds time) {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(fd);
  if (entry == entries_.end()) return;
  entry->second.deadline = Clock::now() + time;
  entry->second.token_id.clear();
}

void ConnectionWatch::closed(int fd) {
  const std::lock_guard lock(mutex_);
  entries_.erase(fd);
}

size_t ConnectionWatch::open() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

void ConnectionWatch::work() {
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

}  // namespace lenticule::web
