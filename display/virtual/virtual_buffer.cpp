// SPDX-License-Identifier: Apache-2.0
#include "display/virtual/virtual_buffer.h"

#include <cstring>
#include <new>

#include "base/error.h"

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

VirtualBuffer::VirtualBuffer(const ScanoutLayout& layout)
    : layout_(layout),
      stride_(stride_words(layout.geometry)),
      words_(static_cast<uint32_t*>(std::aligned_alloc(kCacheLine, bytes(layout.geometry)))) {
  if (!words_) throw std::bad_alloc();
  std::memset(words_.get(), 0, bytes(layout.geometry));
}

void VirtualBuffer::fill(const frames::FrameView& frame) noexcept {
  LENTICULE_CHECK(layout_.takes(frame));
  expand_frame(layout_, frame, words_.get(), stride_);
}

bool VirtualBuffer::try_acquire() noexcept {
  if (state() != BufferState::Free || recording_.load(std::memory_order_acquire)) return false;
  set_state(BufferState::Acquired);
  return true;
}

}  // namespace lenticule::display
