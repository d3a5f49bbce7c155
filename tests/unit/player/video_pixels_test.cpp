// SPDX-License-Identifier: Apache-2.0
// Tests decoded pictures in RGB against the plain formula in double precision, through real files.
#include <gmock/gmock.h>

#include <cstring>
#include <numeric>

#include "apps/lenticule-video/pixel_convert.h"
#include "base/error.h"
#include "tests/support/error_matchers.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/oracles/yuv_oracle.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::video {
namespace {

constexpr int kWidth = 37;
constexpr int kHeight = 19;

using Formula = test::YuvFormula;
using Sampling = test::ChromaSampling;

/// Errors of a channel before it is rounded, in codes. Where the exact value lies in the very
/// middle between two codes, either is right.
constexpr double kExact = 1e-7;
constexpr double kShort = 1.0 / 16.0;  ///< 8 bits with half the columns of chroma

struct Size {
  int width = kWidth;
  int height = kHeight;
};

double error_of(const Formula& formula, const Sampling& sampling) {
  return formula.depth == 8 && sampling.nx == 2 ? kShort : kExact;
}

void expect_formula(const std::vector<uint8_t>& raw, const std::vector<uint8_t>& rgb,
                    const Formula& formula, const Sampling& sampling = {}, const Size& size = {}) {
  EXPECT_EQ(test::find_wrong_channel(
                {.planes = raw, .rgb = rgb, .width = size.width, .height = size.height}, formula,
                sampling, error_of(formula, sampling)),
            std::nullopt);
}

class VideoPixels : public test::VideoTest {
 protected:
  [[nodiscard]] std::vector<uint8_t> decoded(const std::vector<uint8_t>& raw,
                                             const std::string& pixels,
                                             const std::string& tags = "",
                                             bool before_weaving = false) const {
    player::VideoRequest wanted = request(encode("clip.mkv", kWidth, kHeight, raw, pixels, tags));
    wanted.before_weaving = before_weaving;
    return first_frame(wanted);
  }

  [[nodiscard]] std::string refusal(const std::vector<uint8_t>& raw, const std::string& pixels,
                                    const std::string& tags = "") const {
    const std::filesystem::path clip = encode("clip.mkv", kWidth, kHeight, raw, pixels, tags);
    const Error error = test::error_of([&] { (void)player::open_video(request(clip)); });
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return std::string(error.what()) + " / " + error.hint();
  }
};

constexpr size_t kPixels = size_t{kWidth} * kHeight;
constexpr size_t kQuarter = size_t{(kWidth + 1) / 2} * ((kHeight + 1) / 2);

TEST_F(VideoPixels, DeepRgbIsRoundedOnce) {
  const std::vector<uint8_t> raw = test::random_bytes(kPixels * 6, 3);
  const std::vector<uint8_t> rgb = decoded(raw, "rgb48le");
  ASSERT_EQ(rgb.size(), kPixels * 3);
  for (size_t i = 0; i < rgb.size(); ++i)
    ASSERT_EQ(rgb[i], (raw[2 * i] + 256 * raw[2 * i + 1] + 128) / 257) << i;
}

TEST_F(VideoPixels, FullChromaFollowsTheFormula) {
  const std::vector<uint8_t> raw = test::random_bytes(kPixels * 3, 4);
  expect_formula(raw, decoded(raw, "yuv444p", "-colorspace bt709 -color_range tv"),
                 {0.2126, 0.0722, false, 8});
  expect_formula(raw, decoded(raw, "yuv444p", "-colorspace bt709 -color_range pc"),
                 {0.2126, 0.0722, true, 8});
  expect_formula(raw, decoded(raw, "yuv444p", "-colorspace smpte170m -color_range tv"),
                 {0.299, 0.114, false, 8});
}

TEST_F(VideoPixels, DeepChromaFollowsTheFormula) {
  std::vector<uint8_t> raw = test::random_bytes(kPixels * 6, 5);
  for (size_t i = 1; i < raw.size(); i += 2) raw[i] &= 3;
  expect_formula(raw, decoded(raw, "yuv444p10le", "-colorspace bt2020nc -color_range tv"),
                 {0.2627, 0.0593, false, 10});
}

TEST_F(VideoPixels, SubsampledChromaIsRefusedForWovenFrames) {
  const std::vector<uint8_t> raw = test::random_bytes(kPixels + 2 * kQuarter, 6);
  EXPECT_THAT(refusal(raw, "yuv420p"),
              testing::AllOf(testing::HasSubstr("4:2:0"), testing::HasSubstr("--grid 1x1")));
}

TEST_F(VideoPixels, SubsampledChromaIsInterpolatedAtItsSiteBeforeWeaving) {
  const std::vector<uint8_t> raw = test::random_bytes(kPixels + 2 * kQuarter, 7);
  expect_formula(raw, decoded(raw, "yuv420p", "-colorspace bt709 -color_range tv", true),
                 {0.2126, 0.0722, false, 8}, {.nx = 2, .ny = 2, .site_x = 0.0, .site_y = 0.5});
  const std::vector<uint8_t> half =
      test::random_bytes(kPixels + 2 * size_t{(kWidth + 1) / 2} * kHeight, 8);
  expect_formula(half, decoded(half, "yuv422p", "-colorspace bt709 -color_range pc", true),
                 {0.2126, 0.0722, true, 8}, {.nx = 2});
}

TEST_F(VideoPixels, LinearAndFilmTransferFunctionsAreRefused) {
  const std::vector<uint8_t> raw = test::random_bytes(kPixels * 3, 9);
  EXPECT_THAT(refusal(raw, "yuv444p", "-color_trc linear"), testing::HasSubstr("linear"));
  EXPECT_THAT(refusal(raw, "yuv444p", "-color_trc smpte2084"), testing::HasSubstr("smpte2084"));
}

/// Converts planes of random samples by every instruction set and expects the formula.
void expect_formula_everywhere(const PixelLayout& layout, const Size& size,
                               const Sampling& sampling) {
  const int depth = layout.components[0].depth, bytes = depth > 8 ? 2 : 1;
  const int cw = (size.width + sampling.nx - 1) / sampling.nx;
  const int ch = (size.height + sampling.ny - 1) / sampling.ny;
  const size_t luma = static_cast<size_t>(bytes * size.width * size.height);
  const size_t chroma = static_cast<size_t>(bytes * cw * ch);
  std::vector<uint8_t> raw = test::random_bytes(luma + 2 * chroma, 11);
  for (size_t i = 1; bytes == 2 && i < raw.size(); i += 2)
    raw[i] = static_cast<uint8_t>(raw[i] & ((1 << (depth - 8)) - 1));
  std::vector<uint8_t> first;
  for (const Isa isa : test::every_instruction_set()) {
    std::vector<uint8_t> rgb(static_cast<size_t>(size.width * size.height * 3));
    PixelConverter(layout, size.width, size.height, isa)
        .convert({.data = {raw.data(), raw.data() + luma, raw.data() + luma + chroma, nullptr},
                  .stride = {bytes * size.width, bytes * cw, bytes * cw, 0},
                  .width = size.width,
                  .height = size.height},
                 rgb);
    SCOPED_TRACE(isa_name(isa));
    if (first.empty()) first = rgb;
    EXPECT_EQ(rgb, first);
    expect_formula(raw, rgb, {layout.kr, layout.kb, layout.full_range, depth}, sampling, size);
  }
}

PixelLayout yuv_layout(int depth, bool full_range) {
  PixelLayout layout;
  layout.model = ColourModel::Yuv;
  layout.full_range = full_range;
  for (int i = 0; i < 3; ++i)
    layout.components[static_cast<size_t>(i)] = {
        .plane = i, .step = depth > 8 ? 2 : 1, .offset = 0, .shift = 0, .depth = depth};
  return layout;
}

/// Covers all sites, depths on both sides of the kernel's limit, and widths around its blocks.
TEST(PixelConverter, AgreesWithTheFormulaWithEveryInstructionSet) {
  for (const int depth : {8, 10, 12})
    for (const bool full_range : {false, true})
      for (const int shift_x : {0, 1, 2})
        for (const int shift_y : {0, 1})
          for (int site = 0; site < 3; ++site)
            for (const int width : {1, 2, 37, 64, 129}) {
              PixelLayout layout = yuv_layout(depth, full_range);
              layout.chroma_shift_x = shift_x;
              layout.chroma_shift_y = shift_y;
              layout.site = {.across = site, .down = 2 - site};
              const Sampling sampling{.nx = 1 << shift_x,
                                      .ny = 1 << shift_y,
                                      .site_x = site * ((1 << shift_x) - 1) / 2.0,
                                      .site_y = (2 - site) * ((1 << shift_y) - 1) / 2.0};
              expect_formula_everywhere(layout, {.width = width, .height = 5}, sampling);
              ASSERT_FALSE(HasFailure()) << depth << " bits, " << width << " wide, chroma "
                                         << shift_x << shift_y << " site " << site;
            }
}

/// Compares NV12, where Cb and Cr take turns in one plane, with three planes of the same samples.
TEST(PixelConverter, InterleavedChromaGivesTheBytesOfSeparatePlanes) {
  constexpr int kRows = 7;
  for (const Isa isa : test::every_instruction_set())
    for (const int width : {1, 2, 37, 64, 129}) {
      const int half = (width + 1) / 2;
      const size_t luma = static_cast<size_t>(width * kRows);
      const size_t chroma = static_cast<size_t>(half * ((kRows + 1) / 2));
      const std::vector<uint8_t> raw = test::random_bytes(luma + 2 * chroma, 12);
      std::vector<uint8_t> pairs;
      for (size_t i = luma; i < luma + chroma; ++i)
        pairs.insert(pairs.end(), {raw[i], raw[i + chroma]});
      PixelLayout layout = yuv_layout(8, false);
      layout.chroma_shift_x = layout.chroma_shift_y = 1;
      std::vector<uint8_t> separate(luma * 3), interleaved(luma * 3);
      PixelConverter(layout, width, kRows, isa)
          .convert({.data = {raw.data(), raw.data() + luma, raw.data() + luma + chroma, nullptr},
                    .stride = {width, half, half, 0},
                    .width = width,
                    .height = kRows},
                   separate);
      layout.components[1] = {.plane = 1, .step = 2, .offset = 0, .shift = 0, .depth = 8};
      layout.components[2] = {.plane = 1, .step = 2, .offset = 1, .shift = 0, .depth = 8};
      PixelConverter(layout, width, kRows, isa)
          .convert({.data = {raw.data(), pairs.data(), nullptr, nullptr},
                    .stride = {width, 2 * half, 0, 0},
                    .width = width,
                    .height = kRows},
                   interleaved);
      EXPECT_EQ(interleaved, separate) << isa_name(isa) << ", " << width << " wide";
    }
}

/// Tries every colour. Chroma is the same everywhere, so that its interpolation does not matter.
TEST(PixelConverter, SubsampledColoursAreCloseAndGreysExact) {
  for (const bool full_range : {false, true}) {
    PixelLayout layout = yuv_layout(8, full_range);
    layout.chroma_shift_x = layout.chroma_shift_y = 1;
    PixelConverter converter(layout, 256, 1);
    const Formula formula{layout.kr, layout.kb, full_range, 8};
    std::vector<uint8_t> planes(512), rgb(768);
    std::iota(planes.begin(), planes.begin() + 256, uint8_t{0});
    for (int u = 0; u < 256; ++u)
      for (int v = 0; v < 256; ++v) {
        std::memset(planes.data() + 256, u, 128);
        std::memset(planes.data() + 384, v, 128);
        converter.convert(
            {.data = {planes.data(), planes.data() + 256, planes.data() + 384, nullptr},
             .stride = {256, 128, 128, 0},
             .width = 256,
             .height = 1},
            rgb);
        const auto wrong = test::find_wrong_channel(
            {.planes = planes, .rgb = rgb, .width = 256, .height = 1}, formula, {.nx = 2, .ny = 2},
            u == 128 && v == 128 ? kExact : kShort);
        ASSERT_EQ(wrong, std::nullopt) << u << " " << v;
      }
  }
}

/// Random samples of a whole picture: some sums come within the error of the middle of two codes.
TEST(PixelConverter, RoundsSumsNearTheMiddleOfTwoCodesExactly) {
  PixelLayout layout = yuv_layout(10, false);
  layout.chroma_shift_x = layout.chroma_shift_y = 1;
  expect_formula_everywhere(layout, {.width = 1024, .height = 128},
                            {.nx = 2, .ny = 2, .site_x = 0.0, .site_y = 0.5});
}

}  // namespace
}  // namespace lenticule::video
