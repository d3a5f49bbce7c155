// SPDX-License-Identifier: Apache-2.0
#include "base/large_memory.h"

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace lenticule {
namespace {

TEST(LargeMemory, HasAtLeastTheRequestedBytesAligned) {
  for (const size_t bytes : {size_t{1}, size_t{4096}, size_t{5} << 20}) {
    const LargeMemory memory(bytes);
    ASSERT_GE(memory.bytes(), bytes);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(memory.data()) % 64, 0U);
    std::memset(memory.data(), 1, memory.bytes());
  }
}

TEST(LargeMemory, OwnsNothingWithoutBytes) {
  const LargeMemory memory(0);
  EXPECT_EQ(memory.data(), nullptr);
  EXPECT_EQ(memory.bytes(), 0U);
}

TEST(LargeMemory, MovesItsMemory) {
  LargeMemory from(100);
  void* const data = from.data();
  LargeMemory to(std::move(from));
  EXPECT_EQ(to.data(), data);
  LargeMemory other;
  other = std::move(to);
  EXPECT_EQ(other.data(), data);
  EXPECT_GE(other.bytes(), 100U);
}

TEST(LargeMemory, ThrowsIfThereIsNotEnough) {
  EXPECT_THROW(LargeMemory{std::numeric_limits<size_t>::max()}, std::bad_alloc);
}

size_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  size_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<size_t>(sysconf(_SC_PAGESIZE));
}

TEST(ReturnFreeMemory, ShrinksAHeapWhoseLastBlockIsInUse) {
  constexpr size_t kBlock = 64 << 10, kBlocks = 1024;
  std::vector<std::unique_ptr<char[]>> blocks;
  for (size_t n = 0; n < kBlocks; ++n) blocks.push_back(std::make_unique<char[]>(kBlock));
  blocks.erase(blocks.begin(), blocks.end() - 1);
  const size_t before = resident_bytes();
  return_free_memory();
  const bool is_own_heap = mallinfo2().uordblks > 0;  // sanitizers bring another one
  if (is_own_heap) EXPECT_LT(resident_bytes() + kBlock * kBlocks / 2, before);
}

}  // namespace
}  // namespace lenticule
