// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/connection_watch.h"

#include <sys/socket.h>

#include <algorithm>

namespace lenticule::web {
namespace {

constexpr auto kTick = std::chrono::milliseconds(200);

}  // namespace

ConnectionWatch::ConnectionWatch(size_t crowded) : crowded_(crowded) {
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
  ++ended_;
  (void)::shutdown(fd, SHUT_RDWR);
}

void ConnectionWatch::make_room() {
  const size_t live = static_cast<size_t>(std::count_if(
      entries_.begin(), entries_.end(), [](const auto& e) { return !e.second.ended; }));
  if (live < crowded_) return;
  auto oldest = entries_.end();
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    if (entry->second.is_known || entry->second.ended) continue;
    if (oldest == entries_.end() || entry->second.since < oldest->second.since) oldest = entry;
  }
  if (oldest != entries_.end()) end(oldest->first, oldest->second);
}

void ConnectionWatch::opened(int fd, std::chrono::milliseconds time) {
  const std::lock_guard lock(mutex_);
  make_room();
  const Clock::time_point now = Clock::now();
  entries_[fd] = {.deadline = now + time, .since = now};
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

void ConnectionWatch::known(int fd) {
  const std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(fd); entry != entries_.end()) entry->second.is_known = true;
}

void ConnectionWatch::closed(int fd) {
  const std::lock_guard lock(mutex_);
  entries_.erase(fd);
}

size_t ConnectionWatch::open() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

uint64_t ConnectionWatch::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

void ConnectionWatch::work() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    changed_.wait_for(lock, kTick, [this] { return stopping_; });
    const Clock::time_point now = Clock::now();
    for (auto& [fd, entry] : entries_)
      if (entry.deadline <= now) end(fd, entry);
  }
}

}  // namespace lenticule::web
