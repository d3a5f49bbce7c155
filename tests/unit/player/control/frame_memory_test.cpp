// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "base/error.h"
#include "player/control/control_answers.h"

namespace lenticule::player {
namespace {

constexpr frames::FrameGeometry kSize{.width = 5, .height = 3};

TEST(FrameMemory, HoldsTheFrameAndTheTextOfTheNewestWrite) {
  FrameMemory memory(kSize);
  frames::WovenFrame frame(kSize);
  for (const uint8_t value : {uint8_t{7}, uint8_t{9}}) {
    std::fill(frame.bytes().begin(), frame.bytes().end(), value);
    const std::string text = "rig " + std::to_string(value);
    const uint64_t serial = memory.write(frame, text);
    uint64_t stored = 0;
    const int fd = memory.descriptor()->get();
    ASSERT_EQ(::pread(fd, &stored, sizeof stored, 0), ssize_t{sizeof stored});
    EXPECT_EQ(stored, serial);
    std::vector<uint8_t> pixels(frame.bytes().size());
    ASSERT_EQ(::pread(fd, pixels.data(), pixels.size(), FrameMemory::kPixelsAt),
              static_cast<ssize_t>(pixels.size()));
    EXPECT_EQ(std::memcmp(pixels.data(), frame.bytes().data(), pixels.size()), 0);
    std::array<char, 5> read{};
    ASSERT_EQ(::pread(fd, read.data(), read.size(),
                      static_cast<off_t>(FrameMemory::kPixelsAt + pixels.size())),
              5);
    EXPECT_EQ(std::string(read.data(), read.size()), text);
  }
}

TEST(FrameMemory, OthersCanNeitherWriteNorShrinkIt) {
  FrameMemory memory(kSize);
  const int fd = memory.descriptor()->get();
  EXPECT_EQ(::pwrite(fd, "x", 1, 0), -1);
  EXPECT_EQ(::ftruncate(fd, 1), -1);
  EXPECT_EQ(::mmap(nullptr, 64, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0), MAP_FAILED);
  EXPECT_THROW(
      (void)memory.write(frames::WovenFrame(kSize), std::string(FrameMemory::kMaxText + 1, 'a')),
      Error);
}

}  // namespace
}  // namespace lenticule::player
