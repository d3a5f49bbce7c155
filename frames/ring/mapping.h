// SPDX-License-Identifier: Apache-2.0
// Mapping owns one shared memory mapping and unmaps it.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace lenticule::frames {

class Mapping {
 public:
  Mapping() = default;
  /// Maps `bytes` of `fd` from `offset` on, shared; empty when the kernel refuses (see errno).
  /// The offset need not be on a page: pages have up to 64 KiB on ARM, and a ring aligns small
  /// frames to 4 KiB. Children do not inherit the mapping, because they could outlive their
  /// parent's connection. Core dumps exclude the mapping, because its pictures would add gigabytes.
  Mapping(int fd, size_t offset, size_t bytes, int protection) {
    const size_t before = offset % page_bytes();
    void* start = ::mmap(nullptr, before + bytes, protection, MAP_SHARED, fd,
                         static_cast<off_t>(offset - before));
    if (start == MAP_FAILED) return;
    bytes_ = {static_cast<uint8_t*>(start) + before, bytes};
    ::madvise(start, before + bytes, MADV_DONTFORK);
    ::madvise(start, before + bytes, MADV_DONTDUMP);
  }
  Mapping(Mapping&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  Mapping& operator=(Mapping&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Mapping() {
    if (bytes_.empty()) return;
    const size_t before = reinterpret_cast<uintptr_t>(bytes_.data()) % page_bytes();
    ::munmap(bytes_.data() - before, before + bytes_.size());
  }

  explicit operator bool() const { return !bytes_.empty(); }
  [[nodiscard]] std::span<uint8_t> bytes() const { return bytes_; }

 private:
  static size_t page_bytes() { return static_cast<size_t>(::sysconf(_SC_PAGESIZE)); }

  std::span<uint8_t> bytes_;
};

}  // namespace lenticule::frames
