// SPDX-License-Identifier: Apache-2.0
// KnownFiles remembers what was found out about files, as long as they do not change.
#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace lenticule::player {

/// `Key` contains the marks of the files. Thread safety: any thread.
template <class Key, class Found>
class KnownFiles {
 public:
  [[nodiscard]] std::optional<Found> find(const Key& key) const {
    const std::lock_guard lock(mutex_);
    for (const auto& [known, found] : known_)
      if (known == key) return found;
    return std::nullopt;
  }
  void add(const Key& key, const Found& found) {
    const std::lock_guard lock(mutex_);
    known_.emplace_front(key, found);
    if (known_.size() > 1000) known_.pop_back();  // as many as a list may have items
  }

 private:
  mutable std::mutex mutex_;
  std::deque<std::pair<Key, Found>> known_;  ///< newest first
};

}  // namespace lenticule::player
