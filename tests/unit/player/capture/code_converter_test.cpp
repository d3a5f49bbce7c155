// SPDX-License-Identifier: Apache-2.0
// Compares the codes of live pictures with an independent conversion in double precision.
#include "frames/capture/code_converter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "tests/support/error_matchers.h"

namespace lenticule::frames::capture {
namespace {

constexpr int kWidth = 37, kHeight = 21;

/// Coefficients as the recommendations print them, not computed from luma weights.
struct Printed {
  uint32_t encoding;
  double red_cr, green_cb, green_cr, blue_cb;
};
constexpr Printed kPrinted[] = {
    {V4L2_YCBCR_ENC_601, 1.402, -0.344136286, -0.714136286, 1.772},
    {V4L2_YCBCR_ENC_709, 1.5748, -0.187324273, -0.468124273, 1.8556},
    {V4L2_YCBCR_ENC_BT2020, 1.4746, -0.164553127, -0.571353127, 1.8814}};

std::vector<uint8_t> noise(size_t bytes) {
  std::mt19937 random(1);
  std::vector<uint8_t> noise(bytes);
  for (uint8_t& byte : noise) byte = static_cast<uint8_t>(random());
  return noise;
}

struct Ycbcr {
  uint8_t luma, cb, cr;
};
using Sample = std::function<Ycbcr(const std::vector<uint8_t>& bytes, size_t stride, int x, int y)>;

/// Returns the code, or none where the exact value lies so close to a boundary that either
/// neighbour is right.
std::optional<int> rounded(double value) {
  const double codes = value * 255.0;
  if (std::abs(codes - std::floor(codes) - 0.5) < 1e-3) return std::nullopt;
  return static_cast<int>(std::clamp(std::round(codes), 0.0, 255.0));
}

std::vector<uint8_t> converted(const RawFormat& format, const std::vector<uint8_t>& bytes,
                               int threads = 1) {
  CodeConverter converter(format, "/dev/video0");
  const auto width = static_cast<size_t>(format.width), height = static_cast<size_t>(format.height);
  std::vector<uint8_t> codes(width * height * 3);
  EXPECT_TRUE(converter.convert(bytes, {.pixels = codes.data(), .stride = width * 3}, threads));
  return codes;
}

void expect_codes(uint32_t fourcc, size_t stride, size_t bytes, const Sample& sample) {
  const std::vector<uint8_t> picture = noise(bytes);
  for (const Printed& printed : kPrinted)
    for (const bool full : {true, false}) {
      const RawFormat format{
          .fourcc = fourcc,
          .width = kWidth,
          .height = kHeight,
          .bytes_per_line = stride,
          .coding = {.colorspace = V4L2_COLORSPACE_REC709,
                     .ycbcr_enc = printed.encoding,
                     .quantization = static_cast<uint32_t>(full ? V4L2_QUANTIZATION_FULL_RANGE
                                                                : V4L2_QUANTIZATION_LIM_RANGE)}};
      const std::vector<uint8_t> codes = converted(format, picture);
      EXPECT_EQ(converted(format, picture, 3), codes) << "threads change the picture";
      for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
          const Ycbcr at = sample(picture, stride, x, y);
          const double luma = full ? at.luma / 255.0 : (at.luma - 16) / 219.0;
          const double cb = (at.cb - 128) / (full ? 255.0 : 224.0);
          const double cr = (at.cr - 128) / (full ? 255.0 : 224.0);
          const double rgb[] = {luma + printed.red_cr * cr,
                                luma + printed.green_cb * cb + printed.green_cr * cr,
                                luma + printed.blue_cb * cb};
          for (int c = 0; c < 3; ++c) {
            const std::optional<int> code = rounded(rgb[c]);
            if (!code) continue;
            ASSERT_EQ(codes[static_cast<size_t>((y * kWidth + x) * 3 + c)], *code)
                << fourcc_name(fourcc) << " " << x << "," << y << " channel " << c;
          }
        }
    }
}

TEST(CodeConverter, PackedFormatsAgreeWithDoublePrecision) {
  for (const bool uyvy : {false, true}) {
    constexpr size_t kStride = 88;  // 4 bytes for two pixels, and padding
    expect_codes(uyvy ? V4L2_PIX_FMT_UYVY : V4L2_PIX_FMT_YUYV, kStride, kStride * kHeight,
                 [uyvy](const std::vector<uint8_t>& bytes, size_t stride, int x, int y) {
                   const uint8_t* pair =
                       &bytes[static_cast<size_t>(y) * stride + static_cast<size_t>(x / 2) * 4];
                   const int luma = (x % 2) * 2 + (uyvy ? 1 : 0), chroma = uyvy ? 0 : 1;
                   return Ycbcr{pair[luma], pair[chroma], pair[chroma + 2]};
                 });
  }
}

TEST(CodeConverter, PlanarFormatAgreesWithDoublePrecision) {
  constexpr size_t kStride = 40;
  expect_codes(V4L2_PIX_FMT_NV12, kStride, kStride * (kHeight + (kHeight + 1) / 2),
               [](const std::vector<uint8_t>& bytes, size_t stride, int x, int y) {
                 const uint8_t* chroma = &bytes[(kHeight + static_cast<size_t>(y / 2)) * stride +
                                                static_cast<size_t>(x / 2) * 2];
                 return Ycbcr{bytes[static_cast<size_t>(y) * stride + static_cast<size_t>(x)],
                              chroma[0], chroma[1]};
               });
}

TEST(CodeConverter, FullRangeRgbIsUnchangedAndLimitedRangeIsStretched) {
  const std::vector<uint8_t> bgr = {10, 20, 30, 235, 16, 128};
  RawFormat format{.fourcc = V4L2_PIX_FMT_BGR24,
                   .width = 2,
                   .height = 1,
                   .coding = {.quantization = V4L2_QUANTIZATION_FULL_RANGE}};
  EXPECT_EQ(converted(format, bgr), (std::vector<uint8_t>{30, 20, 10, 128, 16, 235}));
  format.coding.quantization = V4L2_QUANTIZATION_LIM_RANGE;
  EXPECT_EQ(converted(format, bgr), (std::vector<uint8_t>{16, 5, 0, 130, 0, 255}));
  format.fourcc = V4L2_PIX_FMT_GREY;
  format.coding.quantization = V4L2_QUANTIZATION_FULL_RANGE;
  EXPECT_EQ(converted(format, bgr), (std::vector<uint8_t>{10, 10, 10, 20, 20, 20}));
}

TEST(CodeConverter, RefusesTooFewBytesAndOtherPictures) {
  CodeConverter packed({.fourcc = V4L2_PIX_FMT_YUYV, .width = 4, .height = 2}, "/dev/video0");
  std::vector<uint8_t> codes(4 * 2 * 3);
  const CodeWindow window{.pixels = codes.data(), .stride = 12};
  EXPECT_TRUE(packed.convert(noise(16), window, 1));
  EXPECT_FALSE(packed.convert(noise(15), window, 1));
  CodeConverter jpeg({.fourcc = V4L2_PIX_FMT_MJPEG, .width = 4, .height = 2}, "/dev/video0");
  EXPECT_FALSE(jpeg.convert(noise(100), window, 1));
  std::vector<uint8_t> begins = noise(100);
  begins[0] = 0xFF;
  begins[1] = 0xD8;
  EXPECT_FALSE(jpeg.convert(begins, window, 1));
  test::expect_error(test::error_of([] {
                       CodeConverter({.fourcc = V4L2_PIX_FMT_SRGGB8, .width = 4, .height = 2},
                                     "/dev/video3");
                     }),
                     ErrorKind::Device, "/dev/video3", "another format");
}

}  // namespace
}  // namespace lenticule::frames::capture
