// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <numeric>
#include <vector>

#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {
namespace {

/// A ring of small frames puts them 4 KiB apart, and a processor may have pages of 16 or 64 KiB.
TEST(Mapping, BeginsAtAnyOffset) {
  std::vector<uint8_t> bytes(300'000);
  std::iota(bytes.begin(), bytes.end(), uint8_t{0});
  const UniqueFd fd(::memfd_create("mapping_test", MFD_CLOEXEC));
  ASSERT_EQ(::write(fd.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  for (const size_t offset : {0, 1, 4096, 12288, 65536, 70001}) {
    const size_t count = bytes.size() - offset;
    Mapping mapping(fd.get(), offset, count, PROT_READ);
    ASSERT_TRUE(mapping) << offset;
    ASSERT_EQ(mapping.bytes().size(), count);
    EXPECT_TRUE(std::equal(mapping.bytes().begin(), mapping.bytes().end(),
                           bytes.begin() + static_cast<ptrdiff_t>(offset)))
        << offset;
  }
}

}  // namespace
}  // namespace lenticule::frames
