// SPDX-License-Identifier: Apache-2.0
// The objects of libdrm, their properties, and requests that change them.
#pragma once

#include <xf86drm.h>
#include <xf86drmMode.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace lenticule::display {

// Owners of objects from libdrm and the kernel; each releases its object once.

template <auto Release>
struct LibdrmDelete {
  template <typename Object>
  void operator()(Object* object) const noexcept {
    Release(object);
  }
};

using DrmResources = std::unique_ptr<drmModeRes, LibdrmDelete<drmModeFreeResources>>;
using DrmConnector = std::unique_ptr<drmModeConnector, LibdrmDelete<drmModeFreeConnector>>;
using DrmCrtc = std::unique_ptr<drmModeCrtc, LibdrmDelete<drmModeFreeCrtc>>;
using DrmPlane = std::unique_ptr<drmModePlane, LibdrmDelete<drmModeFreePlane>>;
using DrmPlanes = std::unique_ptr<drmModePlaneRes, LibdrmDelete<drmModeFreePlaneResources>>;
using DrmProperty = std::unique_ptr<drmModePropertyRes, LibdrmDelete<drmModeFreeProperty>>;
using DrmObjectProperties =
    std::unique_ptr<drmModeObjectProperties, LibdrmDelete<drmModeFreeObjectProperties>>;
using DrmBlob = std::unique_ptr<drmModePropertyBlobRes, LibdrmDelete<drmModeFreePropertyBlob>>;
using DrmVersion = std::unique_ptr<drmVersion, LibdrmDelete<drmFreeVersion>>;
using DrmAtomicReq = std::unique_ptr<drmModeAtomicReq, LibdrmDelete<drmModeAtomicFree>>;

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

struct Property {
  uint32_t id = 0;
  std::string name{};
  uint32_t flags = 0;  ///< DRM_MODE_PROP_*
  uint64_t value = 0;
  uint64_t minimum = 0;  ///< limits of ranges
  uint64_t maximum = 0;
  std::vector<std::pair<std::string, uint64_t>> enums{};  ///< bit numbers for bit masks

  [[nodiscard]] bool writable() const { return (flags & DRM_MODE_PROP_IMMUTABLE) == 0; }
  [[nodiscard]] bool is_blob() const;
  [[nodiscard]] bool is_range() const;
  /// Returns the value (for bit masks: the mask) of the enumerator with this name.
  [[nodiscard]] std::optional<uint64_t> value_named(std::string_view enumerator) const;
  /// Returns text for people: the enumerator's name, "none"/"set" for blobs, the number otherwise.
  [[nodiscard]] std::string text_of(uint64_t of_value) const;
};

/// PropertyTable holds the properties of one KMS object, looked up by their exact names.
class PropertyTable {
 public:
  /// Reads the properties. `object_type` is a DRM_MODE_OBJECT_*. None if the object is gone.
  [[nodiscard]] static std::optional<PropertyTable> read(int fd, uint32_t object,
                                                         uint32_t object_type);

  [[nodiscard]] uint32_t object() const { return object_; }
  [[nodiscard]] const Property* find(std::string_view name) const;
  /// Returns the property's id. Throws Error(Device) if the driver lacks it.
  [[nodiscard]] uint32_t require(std::string_view name) const;
  /// Returns the property's value; 0 if there is no such property.
  [[nodiscard]] uint64_t value(std::string_view name) const;
  [[nodiscard]] const std::vector<Property>& all() const { return properties_; }

 private:
  uint32_t object_ = 0;
  std::vector<Property> properties_;
};

/// Returns the bytes of a blob; empty for id 0 and for blobs that are gone.
[[nodiscard]] std::vector<uint8_t> read_blob(int fd, uint32_t id);

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
  AtomicRequest();

  void clear() noexcept;
  void set(const PropertySetting& setting) noexcept;
  void set(const std::vector<PropertySetting>& settings) noexcept {
    for (const PropertySetting& setting : settings) set(setting);
  }
  /// Commits and returns 0 or a negative errno. `flags` are DRM_MODE_ATOMIC_* and
  /// DRM_MODE_PAGE_FLIP_EVENT; the event carries `user_data`.
  [[nodiscard]] int commit(int fd, uint32_t flags, uint64_t user_data = 0) noexcept;

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
