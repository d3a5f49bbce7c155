// SPDX-License-Identifier: Apache-2.0
// The state of a card's objects as we found it, to be put back when we leave.
#pragma once

#include <cstdint>
#include <vector>

#include "display/kms/device/atomic_request.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

class SavedState {
 public:
  /// Remembers what these settings are about to change. Blobs are copied: the kernel frees them
  /// once nothing refers to them any more.
  void remember(int fd, const std::vector<PropertySetting>& about_to_change,
                const std::vector<const PropertyTable*>& tables);
  [[nodiscard]] bool empty() const { return saved_.empty(); }

  /// Puts everything back with one blocking modeset; where the driver refuses, everything except
  /// the picture and its mode. False if not even that was taken.
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
