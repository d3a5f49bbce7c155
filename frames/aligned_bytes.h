// SPDX-License-Identifier: Apache-2.0
// AlignedBytes is a vector of bytes that begins with a cache line, so that kernels may write it
// past the caches.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

namespace lenticule::frames {

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
