// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_format.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/scanout_words.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/noise_frame.h"
#include "tests/support/turned_picture.h"

namespace lenticule::display {
namespace {

constexpr uint32_t kGuard = 0xDEADBEEF;
constexpr uint8_t kByteGuard = 0xA5;

using test::scanout_word;

constexpr ScanoutDepth kDepths[] = {ScanoutDepth::Bits8, ScanoutDepth::Bits10};

class ScanoutFormat : public testing::TestWithParam<std::tuple<Isa, ScanoutDepth>> {
 protected:
  [[nodiscard]] static Isa isa() { return std::get<0>(GetParam()); }
  [[nodiscard]] static ScanoutDepth depth() { return std::get<1>(GetParam()); }
};

std::vector<uint8_t> random_bytes(size_t count) {
  const auto frame = test::numbered_frame({.width = static_cast<int>(count) + 1, .height = 1}, 7);
  return {frame.bytes().begin(), frame.bytes().begin() + static_cast<ptrdiff_t>(count)};
}

TEST_P(ScanoutFormat, ExpandsEverySubpixelAtEveryWidthAndAlignment) {
  for (size_t pixels = 0; pixels < 100; ++pixels) {
    // The vector has no spare bytes, so that the address sanitizer finds longer reads.
    const std::vector<uint8_t> rgb = random_bytes(3 * pixels);
    std::vector<uint32_t> wanted;
    for (size_t i = 0; i < pixels; ++i) wanted.push_back(scanout_word(rgb.data() + 3 * i, depth()));
    wanted.push_back(kGuard);
    for (size_t shift = 0; shift < 17; ++shift) {
      std::vector<uint32_t> xrgb(shift + pixels + 1, kGuard);
      expand_row(depth(), rgb.data(), xrgb.data() + shift, pixels, isa());
      xrgb.erase(xrgb.begin(), xrgb.begin() + static_cast<ptrdiff_t>(shift));
      ASSERT_EQ(xrgb, wanted) << pixels << " pixels at " << shift;
    }
  }
}

TEST_P(ScanoutFormat, ExpandsEveryValueOfEveryColourAndPacksItBack) {
  for (const size_t colour : {0, 1, 2}) {
    std::vector<uint8_t> rgb(3 * 256);
    for (size_t value = 0; value < 256; ++value)
      rgb[3 * value + colour] = static_cast<uint8_t>(value);
    std::vector<uint32_t> words(256);
    expand_row(depth(), rgb.data(), words.data(), 256, isa());
    for (size_t value = 0; value < 256; ++value)
      ASSERT_EQ(words[value], scanout_word(rgb.data() + 3 * value, depth())) << value;
    std::vector<uint8_t> back(rgb.size());
    pack_row(depth(), words.data(), back.data(), 256, isa());
    ASSERT_EQ(back, rgb);
  }
}

TEST_P(ScanoutFormat, IgnoresTheUnusedBitsWhenPacking) {
  for (size_t pixels = 0; pixels < 100; ++pixels) {
    const std::vector<uint8_t> rgb = random_bytes(3 * pixels);
    std::vector<uint32_t> xrgb(pixels);
    expand_row(depth(), rgb.data(), xrgb.data(), pixels, isa());
    const uint32_t unused = depth() == ScanoutDepth::Bits10 ? 0xC0000000u : 0xFF000000u;
    for (size_t i = 0; i < pixels; i += 2) xrgb[i] |= unused;
    std::vector<uint8_t> back(3 * pixels + 1, kByteGuard);
    pack_row(depth(), xrgb.data(), back.data(), pixels, isa());
    ASSERT_EQ(back.back(), kByteGuard);
    back.pop_back();
    ASSERT_EQ(back, rgb) << pixels << " pixels";
  }
}

/// Checks that the frame which a viewer sees of `sent` is scanned out as `sent` for every mounting,
/// with `shift` words before the first pixel and between the rows.
void expect_sent(Isa isa, ScanoutDepth depth, const frames::WovenFrame& sent, size_t shift) {
  const auto width = static_cast<size_t>(sent.width()), stride = width + shift;
  std::vector<uint32_t> wanted(shift, kGuard);
  for (int row = 0; row < sent.height(); ++row) {
    for (size_t column = 0; column < width; ++column)
      wanted.push_back(scanout_word(sent.row(row) + 3 * column, depth));
    wanted.insert(wanted.end(), shift, kGuard);
  }
  for (const char* mounting : test::kMountingNames) {
    // The frame's bytes are a vector of their own size, so that the address sanitizer finds longer
    // reads.
    const frames::WovenFrame seen = test::seen_of(sent, mounting);
    std::vector<uint32_t> xrgb(wanted.size(), kGuard);
    expand_frame(depth, seen.view(), optics::mounting_named(mounting), xrgb.data() + shift, stride,
                 isa);
    if (xrgb == wanted) continue;
    const auto word =
        static_cast<size_t>(std::ranges::mismatch(xrgb, wanted).in1 - xrgb.begin()) - shift;
    FAIL() << mounting << ", " << sent.width() << "x" << sent.height() << ", pixel "
           << word % stride << ", " << word / stride;
  }
}

TEST_P(ScanoutFormat, SendsWhatTheViewerSeesForEveryMountingSizeAndAlignment) {
  for (int side = 1; side < 24; ++side) {
    expect_sent(isa(), depth(), test::noise_frame(side, 17, 3), 0);
    expect_sent(isa(), depth(), test::noise_frame(19, side, 4), 5);
  }
}

TEST_P(ScanoutFormat, SendsPicturesLargerThanATileWithoutGaps) {
  expect_sent(isa(), depth(), test::noise_frame(203, 137, 5), 5);
}

INSTANTIATE_TEST_SUITE_P(EveryInstructionSet, ScanoutFormat,
                         testing::Combine(testing::ValuesIn(test::every_instruction_set()),
                                          testing::ValuesIn(kDepths)),
                         [](const auto& test) {
                           return std::string(isa_name(std::get<0>(test.param))) + "_" +
                                  std::to_string(bits_of(std::get<1>(test.param)));
                         });

TEST(TenBits, StepsAreEvenAndTheEndsAreKept) {
  const auto ten = [](int value) { return test::ten_bits_of(static_cast<uint8_t>(value)); };
  EXPECT_EQ(ten(0), 0U);
  EXPECT_EQ(ten(255), 1023U);
  int of_five = 0;
  for (int value = 0; value < 255; ++value) {
    const uint32_t step = ten(value + 1) - ten(value);
    ASSERT_TRUE(step == 4 || step == 5) << value;
    of_five += step == 5 ? 1 : 0;
    ASSERT_EQ(ten(value) >> 2, static_cast<uint32_t>(value)) << "the upper eight bits";
    ASSERT_LE(std::abs(ten(value) / 1023.0 - value / 255.0), 0.5 / 1023) << value;
  }
  EXPECT_EQ(of_five, 3) << "1023 is 255 steps of 4 and three more";
}

}  // namespace
}  // namespace lenticule::display
