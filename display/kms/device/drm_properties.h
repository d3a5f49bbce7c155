// SPDX-License-Identifier: Apache-2.0
// The objects of libdrm, their properties, and requests that change them.
#pragma once

#include <xf86drm.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/owned.h"

namespace lenticule::display {

// Owners of objects from libdrm and the kernel; each releases its object once.

using DrmResources = Owned<drmModeRes, drmModeFreeResources>;
using DrmConnector = Owned<drmModeConnector, drmModeFreeConnector>;
using DrmCrtc = Owned<drmModeCrtc, drmModeFreeCrtc>;
using DrmPlane = Owned<drmModePlane, drmModeFreePlane>;
using DrmPlanes = Owned<drmModePlaneRes, drmModeFreePlaneResources>;
using DrmProperty = Owned<drmModePropertyRes, drmModeFreeProperty>;
using DrmObjectProperties = Owned<drmModeObjectProperties, drmModeFreeObjectProperties>;
using DrmBlob = Owned<drmModePropertyBlobRes, drmModeFreePropertyBlob>;
using DrmVersion = Owned<drmVersion, drmFreeVersion>;
using DrmAtomicReq = Owned<drmModeAtomicReq, drmModeAtomicFree>;

/// DrmId owns a kernel object identified by (descriptor, id). Lifetime: the descriptor must outlive
/// it.
template <auto Release>
class DrmId {
 public:
  DrmId() = default;
  DrmId(int fd, uint32_t id) : fd_(fd), id_(id) {}
  DrmId(DrmId&& other) noexcept : fd_(other.fd_), id_(std::exchange(other.id_, 0)) {}
  DrmId& operator=(DrmId&& other) noexcept {
    std::swap(fd_, other.fd_);
    std::swap(id_, other.id_);
    return *this;
  }
  ~DrmId() {
    if (id_ != 0) Release(fd_, id_);
  }

  [[nodiscard]] uint32_t get() const { return id_; }
  explicit operator bool() const { return id_ != 0; }
  /// Releases ownership without destroying the object, which stays with the descriptor.
  void abandon() { id_ = 0; }

 private:
  int fd_ = -1;
  uint32_t id_ = 0;
};

using DumbHandle = DrmId<drmModeDestroyDumbBuffer>;
using FramebufferId = DrmId<drmModeRmFB>;
using BlobId = DrmId<drmModeDestroyPropertyBlob>;

inline uint32_t type_of(uint32_t flags) {
  return flags & (DRM_MODE_PROP_LEGACY_TYPE | DRM_MODE_PROP_EXTENDED_TYPE);
}

struct Property {
  uint32_t id = 0;
  std::string name{};
  uint32_t flags = 0;  ///< DRM_MODE_PROP_*
  uint64_t value = 0;
  uint64_t minimum = 0;  ///< limits of ranges
  uint64_t maximum = 0;
  std::vector<std::pair<std::string, uint64_t>> enums{};  ///< bit numbers for bit masks

  [[nodiscard]] bool writable() const { return (flags & DRM_MODE_PROP_IMMUTABLE) == 0; }
  [[nodiscard]] bool is_blob() const { return type_of(flags) == DRM_MODE_PROP_BLOB; }
  [[nodiscard]] bool is_range() const {
    return type_of(flags) == DRM_MODE_PROP_RANGE || type_of(flags) == DRM_MODE_PROP_SIGNED_RANGE;
  }
  /// Returns the value (for bit masks: the mask) of the enumerator with this name.
  [[nodiscard]] std::optional<uint64_t> value_named(std::string_view enumerator) const {
    for (const auto& [text, number] : enums) {
      if (text != enumerator) continue;
      if (type_of(flags) != DRM_MODE_PROP_BITMASK) return number;
      if (number < 64) return uint64_t{1} << number;
    }
    return std::nullopt;
  }
  /// Returns text for people: the enumerator's name, "none"/"set" for blobs, the number otherwise.
  [[nodiscard]] std::string text_of(uint64_t of_value) const {
    if (is_blob()) return of_value == 0 ? "none" : "set";
    for (const auto& [text, number] : enums)
      if (value_named(text) == of_value) return text;
    return std::to_string(of_value);
  }
};

/// PropertyTable holds the properties of one KMS object, looked up by their exact names.
class PropertyTable {
 public:
  /// Reads the properties. `object_type` is a DRM_MODE_OBJECT_*. None if the object is gone.
  [[nodiscard]] static std::optional<PropertyTable> read(int fd, uint32_t object,
                                                         uint32_t object_type) {
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

  [[nodiscard]] uint32_t object() const { return object_; }
  [[nodiscard]] const Property* find(std::string_view name) const {
    const auto found = std::find_if(properties_.begin(), properties_.end(),
                                    [&](const Property& p) { return p.name == name; });
    return found == properties_.end() ? nullptr : &*found;
  }
  /// Returns the property's id. Throws Error(Device) if the driver lacks it.
  [[nodiscard]] uint32_t require(std::string_view name) const {
    if (const Property* property = find(name)) return property->id;
    throw device_error("KMS object {}: no property '{}'", object_, name)
        .remedy("the graphics driver is too old for atomic modesetting");
  }
  /// Returns the property's value; 0 if there is no such property.
  [[nodiscard]] uint64_t value(std::string_view name) const {
    const Property* property = find(name);
    return property == nullptr ? 0 : property->value;
  }
  [[nodiscard]] const std::vector<Property>& all() const { return properties_; }

 private:
  /// Returns a kernel name, which is padded with zeros and may lack a terminating zero.
  template <size_t N>
  static std::string bounded_text(const char (&text)[N]) {
    return {text, strnlen(text, N)};
  }

  static Property describe(const drmModePropertyRes& source, uint64_t value) {
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
  uint32_t object_ = 0;
  std::vector<Property> properties_;
};

/// Returns the bytes of a blob; empty for id 0 and for blobs that are gone.
[[nodiscard]] inline std::vector<uint8_t> read_blob(int fd, uint32_t id) {
  if (id == 0) return {};
  const DrmBlob blob(drmModeGetPropertyBlob(fd, id));
  if (!blob || blob->data == nullptr) return {};
  const auto* bytes = static_cast<const uint8_t*>(blob->data);
  return {bytes, bytes + blob->length};
}

struct PropertySetting {
  uint32_t object = 0;
  uint32_t property = 0;
  uint64_t value = 0;
  friend bool operator==(const PropertySetting&, const PropertySetting&) = default;
};

inline void append(std::vector<PropertySetting>& to, const std::vector<PropertySetting>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// AtomicRequest is a set of property values that the kernel applies all together or not at all.
/// Can be reused after clear() without allocating memory. Thread safety: one thread.
class AtomicRequest {
 public:
  /// Throws Error(Failed) if memory is exhausted.
  AtomicRequest() : request_(drmModeAtomicAlloc()) {
    if (!request_) throw Error(ErrorKind::Failed, "kms: no memory for an atomic request");
  }

  void clear() noexcept {
    drmModeAtomicSetCursor(request_.get(), 0);
    complete_ = true;
  }
  void set(const PropertySetting& setting) noexcept {
    if (drmModeAtomicAddProperty(request_.get(), setting.object, setting.property, setting.value) <
        0)
      complete_ = false;
  }
  void set(const std::vector<PropertySetting>& settings) noexcept {
    for (const PropertySetting& setting : settings) set(setting);
  }
  /// Commits and returns 0 or a negative errno. `flags` are DRM_MODE_ATOMIC_* and
  /// DRM_MODE_PAGE_FLIP_EVENT; the event carries `user_data`.
  [[nodiscard]] int commit(int fd, uint32_t flags, uint64_t user_data = 0) noexcept {
    if (!complete_) return -ENOMEM;
    // libdrm carries the number in a pointer, which is never dereferenced.
    auto* const carried = reinterpret_cast<void*>(static_cast<uintptr_t>(user_data));
    return drmModeAtomicCommit(fd, request_.get(), flags, carried);
  }

 private:
  DrmAtomicReq request_;
  bool complete_ = true;  ///< no setting was lost for lack of memory
};

/// SavedState stores the state of a card's objects before this process changes it, and restores it
/// at the end.
class SavedState {
 public:
  /// Stores the current values of these settings. Blobs are copied, because the kernel frees them
  /// once they are no longer referenced.
  void remember(int fd, const std::vector<PropertySetting>& about_to_change,
                const std::vector<const PropertyTable*>& tables) {
    saved_.clear();
    for (const PropertySetting& setting : about_to_change) {
      const Property* property = find(tables, setting);
      if (property == nullptr || property->name == "link-status") continue;
      Saved saved{.setting = {setting.object, setting.property, property->value},
                  .blob = {},
                  .is_picture = std::ranges::find(kPictureProperties, property->name) !=
                                kPictureProperties.end()};
      if (property->is_blob()) saved.blob = read_blob(fd, static_cast<uint32_t>(property->value));
      saved_.push_back(std::move(saved));
    }
  }
  [[nodiscard]] bool empty() const { return saved_.empty(); }

  /// Restores all values with one blocking modeset; if the driver refuses, all except the picture
  /// and its mode. Returns false if the driver refuses that too.
  bool restore(int fd) const noexcept {
    try {
      return try_restore(fd, true) || try_restore(fd, false);
    } catch (...) {
      return false;
    }
  }

 private:
  static constexpr std::array<std::string_view, 13> kPictureProperties = {
      "CRTC_ID", "MODE_ID", "ACTIVE", "FB_ID",  "SRC_X",  "SRC_Y",      "SRC_W",
      "SRC_H",   "CRTC_X",  "CRTC_Y", "CRTC_W", "CRTC_H", "link-status"};
  struct Saved {
    PropertySetting setting;
    std::vector<uint8_t> blob;
    bool is_picture = false;  ///< one of kPictureProperties
  };

  static const Property* find(const std::vector<const PropertyTable*>& tables,
                              const PropertySetting& setting) {
    for (const PropertyTable* table : tables) {
      if (table->object() != setting.object) continue;
      for (const Property& property : table->all())
        if (property.id == setting.property) return &property;
    }
    return nullptr;
  }
  [[nodiscard]] bool try_restore(int fd, bool with_picture) const {
    AtomicRequest request;
    std::vector<BlobId> blobs;
    for (const Saved& saved : saved_) {
      if (saved.is_picture && !with_picture) continue;
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

  std::vector<Saved> saved_;
};

}  // namespace lenticule::display
