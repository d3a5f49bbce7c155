// SPDX-License-Identifier: Apache-2.0
// AtomicRequest is a set of property values that the kernel applies all together or not at all.
#pragma once

#include <cstdint>
#include <vector>

#include "display/kms/device/drm_handles.h"

namespace lenticule::display {

struct PropertySetting {
  uint32_t object = 0;
  uint32_t property = 0;
  uint64_t value = 0;
  friend bool operator==(const PropertySetting&, const PropertySetting&) = default;
};

inline void append(std::vector<PropertySetting>& to, const std::vector<PropertySetting>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// Can be reused after clear() without allocating memory. Thread safety: one thread.
class AtomicRequest {
 public:
  /// Throws Error(Failed) if memory is exhausted.
  AtomicRequest();

  void clear() noexcept;
  void set(const PropertySetting& setting) noexcept;
  void set(const std::vector<PropertySetting>& settings) noexcept;
  /// Commits and returns 0 or a negative errno. `flags` are DRM_MODE_ATOMIC_* and
  /// DRM_MODE_PAGE_FLIP_EVENT; the event carries `user_data`.
  [[nodiscard]] int commit(int fd, uint32_t flags, uint64_t user_data = 0) noexcept;

 private:
  DrmAtomicReq request_;
  bool complete_ = true;  ///< no setting was lost for lack of memory
};

}  // namespace lenticule::display
