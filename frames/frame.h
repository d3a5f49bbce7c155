// SPDX-License-Identifier: Apache-2.0
// WovenFrame holds the exact pixels of one panel, one micro-image per lens.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <vector>

namespace lenticule::frames {

// AlignedBytes is a vector of bytes that begins with a cache line, so that kernels may write it
// past the caches.

inline constexpr size_t kCacheLine = 64;

template <class T>
struct CacheLineAllocator {
  using value_type = T;

  CacheLineAllocator() = default;
  template <class Other>
  explicit CacheLineAllocator(const CacheLineAllocator<Other>& /*other*/) noexcept {}

  [[nodiscard]] T* allocate(size_t count) {
    return static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{kCacheLine}));
  }
  void deallocate(T* first, size_t /*count*/) noexcept {
    ::operator delete (first, std::align_val_t{kCacheLine});
  }
  friend bool operator==(const CacheLineAllocator&, const CacheLineAllocator&) = default;
};

using AlignedBytes = std::vector<uint8_t, CacheLineAllocator<uint8_t>>;

}  // namespace lenticule::frames

// Unoptimised callers would construct and destroy each byte in a loop of calls.
extern template class std::vector<uint8_t, lenticule::frames::CacheLineAllocator<uint8_t>>;

namespace lenticule::frames {

enum class PixelFormat : uint32_t {
  Rgb8 = 1,   ///< R, G, B bytes
  Rgb10 = 2,  ///< little-endian 32-bit words x2 r10 g10 b10; part of the design, but the player
              ///< still refuses it
};

[[nodiscard]] constexpr size_t bytes_per_pixel(PixelFormat format) {
  return format == PixelFormat::Rgb8 ? 3 : 4;
}

struct FrameGeometry {
  int width = 0;
  int height = 0;
  PixelFormat format = PixelFormat::Rgb8;

  [[nodiscard]] size_t row_bytes() const {
    return static_cast<size_t>(width) * bytes_per_pixel(format);
  }
  [[nodiscard]] size_t frame_bytes() const { return row_bytes() * static_cast<size_t>(height); }
  friend bool operator==(const FrameGeometry&, const FrameGeometry&) = default;
};

/// FrameView refers to borrowed pixels, rows packed from the top (stride = row_bytes()). A frame
/// for several panels has one picture for each panel in `parts`, in the display's order, and no
/// bytes of its own.
struct FrameView {
  FrameGeometry geometry;
  std::span<const uint8_t> bytes;
  std::span<const FrameView> parts{};

  [[nodiscard]] const uint8_t* row(int j) const {
    return bytes.data() + static_cast<size_t>(j) * geometry.row_bytes();
  }
};

/// WovenFrame owns its pixels, which are black at first. They begin with a cache line.
class WovenFrame {
 public:
  WovenFrame() = default;
  explicit WovenFrame(FrameGeometry geometry)
      : geometry_(geometry), bytes_(geometry.frame_bytes()) {}

  [[nodiscard]] const FrameGeometry& geometry() const { return geometry_; }
  [[nodiscard]] int width() const { return geometry_.width; }
  [[nodiscard]] int height() const { return geometry_.height; }
  [[nodiscard]] std::span<uint8_t> bytes() { return bytes_; }
  [[nodiscard]] std::span<const uint8_t> bytes() const { return bytes_; }
  [[nodiscard]] uint8_t* row(int j) {
    return bytes_.data() + static_cast<size_t>(j) * geometry_.row_bytes();
  }
  [[nodiscard]] const uint8_t* row(int j) const {
    return bytes_.data() + static_cast<size_t>(j) * geometry_.row_bytes();
  }
  [[nodiscard]] FrameView view() const { return {geometry_, bytes_}; }
  friend bool operator==(const WovenFrame&, const WovenFrame&) = default;

 private:
  FrameGeometry geometry_;
  AlignedBytes bytes_;
};

}  // namespace lenticule::frames
