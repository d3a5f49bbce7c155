// SPDX-License-Identifier: Apache-2.0
// Memory for tables of many megabytes. Linux backs it with huge pages where it can: a table is then
// filled with a few page faults instead of thousands, each of which is slow in a virtual machine.
#pragma once

#include <cstddef>

namespace lenticule {

/// LargeMemory owns uninitialised memory, aligned for every vector type.
class LargeMemory {
 public:
  LargeMemory() = default;
  /// Throws std::bad_alloc.
  explicit LargeMemory(size_t bytes);
  ~LargeMemory();
  LargeMemory(LargeMemory&& other) noexcept;
  LargeMemory& operator=(LargeMemory&& other) noexcept;

  [[nodiscard]] void* data() const { return data_; }
  /// Returns the size, which is at least the requested one.
  [[nodiscard]] size_t bytes() const { return bytes_; }

 private:
  void* data_ = nullptr;
  size_t bytes_ = 0;
};

/// Gives freed memory back to the system. The C library would keep it, and its pools grow slowly in
/// a process that allocates for hours. Takes some milliseconds.
///
/// Thread safety: any thread.
void return_free_memory() noexcept;

/// Frames after which a renderer that serves a player calls return_free_memory().
inline constexpr int kFramesPerReturn = 256;

}  // namespace lenticule
