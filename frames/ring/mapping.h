// SPDX-License-Identifier: Apache-2.0
// Mapping owns one shared memory mapping and unmaps it.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace lenticule::frames {

class Mapping {
 public:
  Mapping() = default;
  /// Maps `bytes` of `fd` from `offset` on, shared; empty when the kernel refuses (see errno).
  /// Children do not inherit the mapping, because they could outlive their parent's connection.
  /// Core dumps exclude the mapping, because its pictures would add gigabytes.
  Mapping(int fd, size_t offset, size_t bytes, int protection) {
    void* start = ::mmap(nullptr, bytes, protection, MAP_SHARED, fd, static_cast<off_t>(offset));
    if (start == MAP_FAILED) return;
    bytes_ = {static_cast<uint8_t*>(start), bytes};
    ::madvise(start, bytes, MADV_DONTFORK);
    ::madvise(start, bytes, MADV_DONTDUMP);
  }
  Mapping(Mapping&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  Mapping& operator=(Mapping&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Mapping() {
    if (!bytes_.empty()) ::munmap(bytes_.data(), bytes_.size());
  }

  explicit operator bool() const { return !bytes_.empty(); }
  [[nodiscard]] std::span<uint8_t> bytes() const { return bytes_; }

 private:
  std::span<uint8_t> bytes_;
};

}  // namespace lenticule::frames
