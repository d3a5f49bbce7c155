// SPDX-License-Identifier: Apache-2.0
// SavedState stores the state of a card's objects before this process changes it, and restores it
// at the end.
#pragma once

#include <cstdint>
#include <vector>

#include "display/kms/device/atomic_request.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

class SavedState {
 public:
  /// Stores the current values of these settings. Blobs are copied, because the kernel frees them
  /// once they are no longer referenced.
  void remember(int fd, const std::vector<PropertySetting>& about_to_change,
                const std::vector<const PropertyTable*>& tables);
  [[nodiscard]] bool empty() const { return saved_.empty(); }

  /// Restores all values with one blocking modeset; if the driver refuses, all except the picture
  /// and its mode. Returns false if the driver refuses that too.
  bool restore(int fd) const noexcept;

 private:
  enum class What { Picture, Setting };
  struct Saved {
    PropertySetting setting;
    std::vector<uint8_t> blob;
    What what = What::Setting;
  };

  [[nodiscard]] bool try_restore(int fd, bool with_picture) const;

  std::vector<Saved> saved_;
};

}  // namespace lenticule::display
