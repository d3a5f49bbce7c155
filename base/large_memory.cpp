// SPDX-License-Identifier: Apache-2.0
#include "base/large_memory.h"

#include <malloc.h>
#include <sys/mman.h>

#include <cstdlib>
#include <new>
#include <utility>

namespace lenticule {
namespace {

constexpr size_t kHugePage = size_t{2} << 20;

}  // namespace

LargeMemory::LargeMemory(size_t bytes) : bytes_((bytes + kHugePage - 1) / kHugePage * kHugePage) {
  if (bytes_ < bytes) throw std::bad_alloc();
  if (bytes_ == 0) return;
  data_ = std::aligned_alloc(kHugePage, bytes_);
  if (data_ == nullptr) throw std::bad_alloc();
  // Advice only: without huge pages the memory works, too.
  static_cast<void>(madvise(data_, bytes_, MADV_HUGEPAGE));
}

LargeMemory::~LargeMemory() {
  std::free(data_);
}

LargeMemory::LargeMemory(LargeMemory&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

LargeMemory& LargeMemory::operator=(LargeMemory&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

void return_free_memory() noexcept {
  static_cast<void>(::malloc_trim(0));
}

}  // namespace lenticule
