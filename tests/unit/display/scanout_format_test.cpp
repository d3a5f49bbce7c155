// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_format.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/fake_source.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/noise_frame.h"
#include "tests/support/turned_picture.h"

namespace lenticule::display {
namespace {

constexpr uint32_t kGuard = 0xDEADBEEF;
constexpr uint8_t kByteGuard = 0xA5;

class ScanoutFormat : public testing::TestWithParam<Isa> {};

std::vector<uint8_t> random_bytes(size_t count) {
  const auto frame = test::numbered_frame({.width = static_cast<int>(count) + 1, .height = 1}, 7);
  return {frame.bytes().begin(), frame.bytes().begin() + static_cast<ptrdiff_t>(count)};
}

TEST_P(ScanoutFormat, ExpandsEverySubpixelAtEveryWidthAndAlignment) {
  for (size_t pixels = 0; pixels < 100; ++pixels)
    for (size_t shift = 0; shift < 9; ++shift) {
      // The vector has no spare bytes, so that the address sanitizer finds longer reads.
      const std::vector<uint8_t> rgb = random_bytes(3 * pixels);
      std::vector<uint32_t> xrgb(shift + pixels + 1, kGuard);
      expand_row(GetParam(), rgb.data(), xrgb.data() + shift, pixels);
      for (size_t i = 0; i < pixels; ++i)
        ASSERT_EQ(xrgb[shift + i], uint32_t{rgb[3 * i]} << 16 | uint32_t{rgb[3 * i + 1]} << 8 |
                                       uint32_t{rgb[3 * i + 2]})
            << "pixel " << i << " of " << pixels;
      ASSERT_EQ(xrgb[shift + pixels], kGuard);
    }
}

TEST_P(ScanoutFormat, IgnoresTheXByteWhenPacking) {
  for (size_t pixels = 0; pixels < 100; ++pixels) {
    const std::vector<uint8_t> rgb = random_bytes(3 * pixels);
    std::vector<uint32_t> xrgb(pixels);
    expand_row(GetParam(), rgb.data(), xrgb.data(), pixels);
    for (size_t i = 0; i < pixels; i += 2) xrgb[i] |= 0xFF000000u;
    std::vector<uint8_t> back(3 * pixels + 1, kByteGuard);
    pack_row(GetParam(), xrgb.data(), back.data(), pixels);
    ASSERT_EQ(back.back(), kByteGuard);
    back.pop_back();
    ASSERT_EQ(back, rgb) << pixels << " pixels";
  }
}

/// Checks that the frame which a viewer sees of `sent` is scanned out as `sent`, with `shift` words
/// before the first pixel and between the rows.
void expect_sent(Isa isa, const frames::WovenFrame& sent, const char* mounting, size_t shift) {
  // The frame's bytes are a vector of their own size, so that the address sanitizer finds longer
  // reads.
  const frames::WovenFrame seen = test::seen_of(sent, mounting);
  const auto width = static_cast<size_t>(sent.width()), stride = width + shift;
  std::vector<uint32_t> xrgb(shift + stride * static_cast<size_t>(sent.height()), kGuard);
  expand_frame(isa, seen.view(), optics::mounting_named(mounting), xrgb.data() + shift, stride);
  for (size_t word = 0; word < xrgb.size(); ++word) {
    const bool guard = word < shift || (word - shift) % stride >= width;
    const size_t row = (word - shift) / stride, column = (word - shift) % stride;
    const uint8_t* const rgb =
        guard ? nullptr : sent.row(static_cast<int>(row)) + 3 * static_cast<ptrdiff_t>(column);
    const uint32_t wanted =
        guard ? kGuard : uint32_t{rgb[0]} << 16 | uint32_t{rgb[1]} << 8 | uint32_t{rgb[2]};
    ASSERT_EQ(xrgb[word], wanted) << mounting << ", " << sent.width() << "x" << sent.height()
                                  << ", pixel " << column << ", " << row;
  }
}

TEST_P(ScanoutFormat, SendsWhatTheViewerSeesForEveryMountingSizeAndAlignment) {
  for (const char* mounting : test::kMountingNames)
    for (int side = 1; side < 24; ++side) {
      expect_sent(GetParam(), test::noise_frame(side, 17, 3), mounting, 0);
      expect_sent(GetParam(), test::noise_frame(19, side, 4), mounting, 5);
    }
}

TEST_P(ScanoutFormat, SendsPicturesLargerThanATileWithoutGaps) {
  for (const char* mounting : test::kMountingNames)
    expect_sent(GetParam(), test::noise_frame(203, 137, 5), mounting, 5);
}

INSTANTIATE_TEST_SUITE_P(EveryInstructionSet, ScanoutFormat,
                         testing::ValuesIn(test::every_instruction_set()),
                         [](const auto& isa) { return std::string(isa_name(isa.param)); });

}  // namespace
}  // namespace lenticule::display
