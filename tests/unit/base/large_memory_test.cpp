// SPDX-License-Identifier: Apache-2.0
#include "base/large_memory.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <utility>

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

}  // namespace
}  // namespace lenticule
