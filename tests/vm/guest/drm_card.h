// SPDX-License-Identifier: Apache-2.0
// Wraps the parts of libdrm that the guest's test programs share: owned handles, properties by
// name.
#pragma once

#include <sys/mman.h>
#include <unistd.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

namespace lenticule::vm {

// Throws with errno's text unless a libdrm call returned 0 or more.
inline int checked(int result, const std::string& what) {
  if (result < 0) throw std::runtime_error(what + ": " + std::strerror(errno));
  return result;
}

template <auto Free>
struct Freed {
  template <typename T>
  void operator()(T* pointer) const {
    Free(pointer);
  }
};
using Resources = std::unique_ptr<drmModeRes, Freed<drmModeFreeResources>>;
using Connector = std::unique_ptr<drmModeConnector, Freed<drmModeFreeConnector>>;
using Crtc = std::unique_ptr<drmModeCrtc, Freed<drmModeFreeCrtc>>;
using Properties = std::unique_ptr<drmModeObjectProperties, Freed<drmModeFreeObjectProperties>>;
using Property = std::unique_ptr<drmModePropertyRes, Freed<drmModeFreeProperty>>;
using AtomicRequest = std::unique_ptr<drmModeAtomicReq, Freed<drmModeAtomicFree>>;

// Owns a file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~Descriptor() {
    if (fd_ >= 0) close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

struct NamedProperty {
  uint32_t id = 0;
  uint64_t value = 0;
};

// Returns a property of a KMS object by its exact name; throws if there is none.
inline NamedProperty property(int fd, uint32_t object, uint32_t type, const std::string& name) {
  const Properties all(drmModeObjectGetProperties(fd, object, type));
  for (uint32_t i = 0; all && i < all->count_props; ++i) {
    const Property one(drmModeGetProperty(fd, all->props[i]));
    if (one && one->name == name) return {one->prop_id, all->prop_values[i]};
  }
  throw std::runtime_error("no property '" + name + "'");
}

// Adds one assignment to an atomic request, by the property's name.
inline void assign(int fd, drmModeAtomicReq* request, uint32_t object, uint32_t type,
                   const std::string& name, uint64_t value) {
  const uint32_t id = property(fd, object, type, name).id;
  checked(drmModeAtomicAddProperty(request, object, id, value), "cannot ask for " + name);
}

// A mapped XRGB8888 buffer with its framebuffer; both are removed from the card at the end.
class DumbBuffer {
 public:
  DumbBuffer(int fd, uint32_t width, uint32_t height) : fd_(fd), width_(width), height_(height) {
    checked(drmModeCreateDumbBuffer(fd, width, height, 32, 0, &handle_, &pitch_, &size_),
            "cannot create a buffer");
    const uint32_t handles[4] = {handle_}, pitches[4] = {pitch_}, offsets[4] = {};
    checked(drmModeAddFB2(fd, width, height, fourcc_xrgb8888, handles, pitches, offsets,
                          &framebuffer_, 0),
            "cannot make a framebuffer");
    uint64_t offset = 0;
    checked(drmModeMapDumbBuffer(fd, handle_, &offset), "cannot map the buffer");
    void* mapped =
        mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<off_t>(offset));
    if (mapped == MAP_FAILED) throw std::runtime_error("cannot map the buffer");
    pixels_ = static_cast<uint8_t*>(mapped);
  }
  DumbBuffer(const DumbBuffer&) = delete;
  DumbBuffer& operator=(const DumbBuffer&) = delete;
  ~DumbBuffer() {
    munmap(pixels_, size_);
    drmModeRmFB(fd_, framebuffer_);
    drmModeDestroyDumbBuffer(fd_, handle_);
  }

  uint32_t framebuffer() const { return framebuffer_; }
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  // Returns row y: width() pixels of 4 bytes, blue, green, red, unused.
  std::span<uint8_t> row(uint32_t y) {
    return {pixels_ + static_cast<size_t>(y) * pitch_, static_cast<size_t>(width_) * 4};
  }

 private:
  static constexpr uint32_t fourcc_xrgb8888 = 0x34325258;  // "XR24"
  int fd_;
  uint32_t width_, height_;
  uint32_t handle_ = 0, pitch_ = 0, framebuffer_ = 0;
  uint64_t size_ = 0;
  uint8_t* pixels_ = nullptr;
};

}  // namespace lenticule::vm
