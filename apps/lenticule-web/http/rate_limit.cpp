// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/rate_limit.h"

#include <algorithm>

namespace lenticule::web {

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

}  // namespace lenticule::web
