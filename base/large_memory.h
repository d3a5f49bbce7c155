// SPDX-License-Identifier: Apache-2.0
// Memory for tables of many megabytes. Linux backs it with huge pages where it can: a table is then
// filled with a few page faults instead of thousands, each of which is slow in a virtual machine.
#pragma once

#include <malloc.h>
#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <new>
#include <string>
#include <utility>

namespace lenticule {

/// LargeMemory owns uninitialised memory, aligned for every vector type.
class LargeMemory {
 public:
  LargeMemory() = default;
  /// Throws std::bad_alloc.
  explicit LargeMemory(size_t bytes) : bytes_((bytes + kHugePage - 1) / kHugePage * kHugePage) {
    if (bytes_ < bytes) throw std::bad_alloc();
    if (bytes_ == 0) return;
    data_ = std::aligned_alloc(kHugePage, bytes_);
    if (data_ == nullptr) throw std::bad_alloc();
    // Advice only: without huge pages the memory works, too.
    static_cast<void>(madvise(data_, bytes_, MADV_HUGEPAGE));
  }
  ~LargeMemory() { std::free(data_); }
  LargeMemory(LargeMemory&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
  LargeMemory& operator=(LargeMemory&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }

  [[nodiscard]] void* data() const { return data_; }
  /// Returns the size, which is at least the requested one.
  [[nodiscard]] size_t bytes() const { return bytes_; }

 private:
  static constexpr size_t kHugePage = size_t{2} << 20;
  void* data_ = nullptr;
  size_t bytes_ = 0;
};

/// Gives freed memory back to the system. The C library would keep it, and its pools grow slowly in
/// a process that allocates for hours. Takes some milliseconds.
///
/// Thread safety: any thread.
inline void return_free_memory() noexcept { static_cast<void>(::malloc_trim(0)); }

/// Returns the bytes available without swapping, from /proc/meminfo; 0 if unknown.
inline uint64_t available_memory() {
  std::ifstream meminfo("/proc/meminfo");
  for (std::string line; std::getline(meminfo, line);)
    if (unsigned long long kibibytes = 0;
        std::sscanf(line.c_str(), "MemAvailable: %llu kB", &kibibytes) == 1)
      return kibibytes * 1024;
  return 0;
}

/// Frames after which a renderer that serves a player calls return_free_memory().
inline constexpr int kFramesPerReturn = 256;

}  // namespace lenticule
