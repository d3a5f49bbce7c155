// SPDX-License-Identifier: Apache-2.0
// Reads the picture that a card scans out for another program, as a camera in front of the panel
// would.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>

#include <optional>
#include <string>

#include "drm_card.h"
#include "frames/frame.h"

namespace lenticule::vm {

using Framebuffer = std::unique_ptr<drmModeFB2, Freed<drmModeFreeFB2>>;

// The pixels of another program's dumb buffer, for reading. Only root has access to such buffers.
class ForeignBuffer {
 public:
  ForeignBuffer(int fd, const drmModeFB2& framebuffer) : fd_(fd), handle_(framebuffer.handles[0]) {
    size_ =
        framebuffer.offsets[0] + static_cast<size_t>(framebuffer.pitches[0]) * framebuffer.height;
    uint64_t offset = 0;
    if (handle_ == 0 || drmModeMapDumbBuffer(fd, handle_, &offset) != 0) return;
    void* mapped = mmap(nullptr, size_, PROT_READ, MAP_SHARED, fd, static_cast<off_t>(offset));
    if (mapped != MAP_FAILED)
      pixels_ = static_cast<const uint8_t*>(mapped) + framebuffer.offsets[0];
    offset_ = framebuffer.offsets[0];
  }
  ForeignBuffer(const ForeignBuffer&) = delete;
  ForeignBuffer& operator=(const ForeignBuffer&) = delete;
  ~ForeignBuffer() {
    if (pixels_) munmap(const_cast<uint8_t*>(pixels_ - offset_), size_);
    if (handle_ != 0) drmCloseBufferHandle(fd_, handle_);
  }

  // Returns null if the buffer could not be mapped, since its owner may just have removed it.
  const uint8_t* pixels() const { return pixels_; }

 private:
  int fd_;
  uint32_t handle_;
  size_t size_ = 0, offset_ = 0;
  const uint8_t* pixels_ = nullptr;
};

class ScannedOut {
 public:
  explicit ScannedOut(const std::string& card)
      : card_(checked(open(card.c_str(), O_RDWR | O_CLOEXEC), card)) {
    // The first program that opens a card becomes its master, which must be the program under test.
    drmDropMaster(card_.get());
  }

  // Returns the picture of the first CRTC that shows one; nothing if none does.
  std::optional<frames::WovenFrame> read() {
    const uint32_t id = framebuffer_id();
    const Framebuffer framebuffer(id == 0 ? nullptr : drmModeGetFB2(card_.get(), id));
    if (!framebuffer || framebuffer->pixel_format != fourcc_xrgb8888) return std::nullopt;
    const ForeignBuffer buffer(card_.get(), *framebuffer);
    if (!buffer.pixels()) return std::nullopt;
    return copy_of(buffer.pixels(), *framebuffer);
  }

 private:
  static constexpr uint32_t fourcc_xrgb8888 = 0x34325258;  // "XR24"

  uint32_t framebuffer_id() const {
    const Resources resources(drmModeGetResources(card_.get()));
    for (int i = 0; resources && i < resources->count_crtcs; ++i) {
      const Crtc crtc(drmModeGetCrtc(card_.get(), resources->crtcs[i]));
      if (crtc && crtc->mode_valid && crtc->buffer_id != 0) return crtc->buffer_id;
    }
    return 0;
  }

  // The buffer's bytes are blue, green, red, unused.
  static frames::WovenFrame copy_of(const uint8_t* pixels, const drmModeFB2& framebuffer) {
    const int width = static_cast<int>(framebuffer.width);
    frames::WovenFrame frame({width, static_cast<int>(framebuffer.height)});
    for (int y = 0; y < frame.height(); ++y) {
      const uint8_t* from = pixels + static_cast<size_t>(y) * framebuffer.pitches[0];
      uint8_t* to = frame.row(y);
      for (int x = 0; x < width; ++x, from += 4, to += 3) {
        to[0] = from[2];
        to[1] = from[1];
        to[2] = from[0];
      }
    }
    return frame;
  }

  Descriptor card_;
};

}  // namespace lenticule::vm
