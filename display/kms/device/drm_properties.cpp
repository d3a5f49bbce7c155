// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/drm_properties.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace lenticule::display {
namespace {

/// Returns a kernel name, which is padded with zeros and may lack a terminating zero.
template <size_t N>
std::string bounded_text(const char (&text)[N]) {
  return {text, strnlen(text, N)};
}

uint32_t type_of(uint32_t flags) {
  return flags & (DRM_MODE_PROP_LEGACY_TYPE | DRM_MODE_PROP_EXTENDED_TYPE);
}

Property describe(const drmModePropertyRes& source, uint64_t value) {
  Property property{.id = source.prop_id,
                    .name = bounded_text(source.name),
                    .flags = source.flags,
                    .value = value};
  if (property.is_range() && source.count_values >= 2) {
    property.minimum = source.values[0];
    property.maximum = source.values[1];
  }
  for (int i = 0; i < source.count_enums; ++i)
    property.enums.emplace_back(bounded_text(source.enums[i].name), source.enums[i].value);
  return property;
}

}  // namespace

bool Property::is_blob() const {
  return type_of(flags) == DRM_MODE_PROP_BLOB;
}

bool Property::is_range() const {
  return type_of(flags) == DRM_MODE_PROP_RANGE || type_of(flags) == DRM_MODE_PROP_SIGNED_RANGE;
}

std::optional<uint64_t> Property::value_named(std::string_view enumerator) const {
  for (const auto& [text, number] : enums) {
    if (text != enumerator) continue;
    if (type_of(flags) != DRM_MODE_PROP_BITMASK) return number;
    if (number < 64) return uint64_t{1} << number;
  }
  return std::nullopt;
}

std::string Property::text_of(uint64_t of_value) const {
  if (is_blob()) return of_value == 0 ? "none" : "set";
  for (const auto& [text, number] : enums)
    if (value_named(text) == of_value) return text;
  return std::to_string(of_value);
}

std::optional<PropertyTable> PropertyTable::read(int fd, uint32_t object, uint32_t object_type) {
  const DrmObjectProperties listed(drmModeObjectGetProperties(fd, object, object_type));
  if (!listed) return std::nullopt;
  PropertyTable table;
  table.object_ = object;
  for (uint32_t i = 0; i < listed->count_props; ++i) {
    const DrmProperty property(drmModeGetProperty(fd, listed->props[i]));
    if (property) table.properties_.push_back(describe(*property, listed->prop_values[i]));
  }
  return table;
}

const Property* PropertyTable::find(std::string_view name) const {
  const auto found = std::find_if(properties_.begin(), properties_.end(),
                                  [&](const Property& p) { return p.name == name; });
  return found == properties_.end() ? nullptr : &*found;
}

uint32_t PropertyTable::require(std::string_view name) const {
  if (const Property* property = find(name)) return property->id;
  throw Error(ErrorKind::Device, fmt::format("KMS object {}: no property '{}'", object_, name),
              "the graphics driver is too old for atomic modesetting");
}

uint64_t PropertyTable::value(std::string_view name) const {
  const Property* property = find(name);
  return property == nullptr ? 0 : property->value;
}

std::vector<uint8_t> read_blob(int fd, uint32_t id) {
  if (id == 0) return {};
  const DrmBlob blob(drmModeGetPropertyBlob(fd, id));
  if (!blob || blob->data == nullptr) return {};
  const auto* bytes = static_cast<const uint8_t*>(blob->data);
  return {bytes, bytes + blob->length};
}

AtomicRequest::AtomicRequest() : request_(drmModeAtomicAlloc()) {
  if (!request_) throw Error(ErrorKind::Failed, "kms: no memory for an atomic request");
}

void AtomicRequest::clear() noexcept {
  drmModeAtomicSetCursor(request_.get(), 0);
  complete_ = true;
}

void AtomicRequest::set(const PropertySetting& setting) noexcept {
  if (drmModeAtomicAddProperty(request_.get(), setting.object, setting.property, setting.value) < 0)
    complete_ = false;
}

int AtomicRequest::commit(int fd, uint32_t flags, uint64_t user_data) noexcept {
  if (!complete_) return -ENOMEM;
  // libdrm carries the number in a pointer, which is never dereferenced.
  auto* const carried = reinterpret_cast<void*>(static_cast<uintptr_t>(user_data));
  return drmModeAtomicCommit(fd, request_.get(), flags, carried);
}

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
