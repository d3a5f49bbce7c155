// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/saved_state.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "display/kms/device/drm_handles.h"

namespace lenticule::display {
namespace {

constexpr std::array<std::string_view, 13> kPictureProperties = {
    "CRTC_ID", "MODE_ID", "ACTIVE", "FB_ID",  "SRC_X",  "SRC_Y",      "SRC_W",
    "SRC_H",   "CRTC_X",  "CRTC_Y", "CRTC_W", "CRTC_H", "link-status"};

const Property* find(const std::vector<const PropertyTable*>& tables,
                     const PropertySetting& setting) {
  for (const PropertyTable* table : tables) {
    if (table->object() != setting.object) continue;
    for (const Property& property : table->all())
      if (property.id == setting.property) return &property;
  }
  return nullptr;
}

}  // namespace

void SavedState::remember(int fd, const std::vector<PropertySetting>& about_to_change,
                          const std::vector<const PropertyTable*>& tables) {
  saved_.clear();
  for (const PropertySetting& setting : about_to_change) {
    const Property* property = find(tables, setting);
    if (property == nullptr || property->name == "link-status") continue;
    const bool picture = std::find(kPictureProperties.begin(), kPictureProperties.end(),
                                   property->name) != kPictureProperties.end();
    Saved saved{.setting = {setting.object, setting.property, property->value},
                .blob = {},
                .what = picture ? What::Picture : What::Setting};
    if (property->is_blob()) saved.blob = read_blob(fd, static_cast<uint32_t>(property->value));
    saved_.push_back(std::move(saved));
  }
}

bool SavedState::try_restore(int fd, bool with_picture) const {
  AtomicRequest request;
  std::vector<BlobId> blobs;
  for (const Saved& saved : saved_) {
    if (saved.what == What::Picture && !with_picture) continue;
    PropertySetting setting = saved.setting;
    if (!saved.blob.empty()) {
      uint32_t id = 0;
      if (drmModeCreatePropertyBlob(fd, saved.blob.data(), saved.blob.size(), &id) != 0) continue;
      blobs.emplace_back(fd, id);
      setting.value = id;
    }
    request.set(setting);
  }
  return request.commit(fd, DRM_MODE_ATOMIC_ALLOW_MODESET) == 0;
}

bool SavedState::restore(int fd) const noexcept {
  try {
    return try_restore(fd, true) || try_restore(fd, false);
  } catch (...) {
    return false;
  }
}

}  // namespace lenticule::display
