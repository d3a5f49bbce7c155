// SPDX-License-Identifier: Apache-2.0
#include "display/virtual/virtual_buffer.h"

#include <cstring>
#include <new>

#include "base/error.h"
#include "display/scanout_format.h"

namespace lenticule::display {
namespace {

constexpr size_t kCacheLine = 64;

/// Returns the words per row. Rows start on cache lines, so that streaming stores are aligned.
size_t stride_words(frames::FrameGeometry geometry) noexcept {
  constexpr size_t kWords = kCacheLine / sizeof(uint32_t);
  return (static_cast<size_t>(geometry.width) + kWords - 1) / kWords * kWords;
}

}  // namespace

size_t VirtualBuffer::bytes(frames::FrameGeometry geometry) noexcept {
  return stride_words(geometry) * static_cast<size_t>(geometry.height) * sizeof(uint32_t);
}

VirtualBuffer::VirtualBuffer(frames::FrameGeometry geometry, const optics::Mounting& mounting,
                             ScanoutDepth depth)
    : geometry_(geometry),
      mounting_(mounting),
      depth_(depth),
      stride_(stride_words(geometry)),
      words_(static_cast<uint32_t*>(std::aligned_alloc(kCacheLine, bytes(geometry)))) {
  if (!words_) throw std::bad_alloc();
  std::memset(words_.get(), 0, bytes(geometry));
}

void VirtualBuffer::fill(const frames::FrameView& frame) noexcept {
  LENTICULE_CHECK(turned(frame.geometry, mounting_) == geometry_ &&
                  frame.bytes.size() >= geometry_.frame_bytes());
  expand_frame(depth_, frame, mounting_, words_.get(), stride_);
}

bool VirtualBuffer::try_acquire() noexcept {
  if (state() != BufferState::Free || recording_.load(std::memory_order_acquire)) return false;
  set_state(BufferState::Acquired);
  return true;
}

}  // namespace lenticule::display
