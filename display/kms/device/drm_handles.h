// SPDX-License-Identifier: Apache-2.0
// Owners of objects from libdrm and the kernel; each releases its object once.
#pragma once

#include <xf86drm.h>
#include <xf86drmMode.h>

#include <cstdint>
#include <memory>
#include <utility>

namespace lenticule::display {

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

}  // namespace lenticule::display
