// SPDX-License-Identifier: Apache-2.0
// Tests that bytes of known colours are decoded to their light, and damaged ones are rejected.
#include "calib/cameras/pixel_unpack.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "tests/support/error_matchers.h"

namespace lenticule::calib {
namespace {

using Bytes = std::vector<uint8_t>;
using Colour = std::array<double, 3>;

RawFormat format_of(uint32_t fourcc, int width, int height, size_t bytes_per_line = 0) {
  RawFormat format{.fourcc = fourcc,
                   .width = width,
                   .height = height,
                   .bytes_per_line = bytes_per_line,
                   .coding = {}};
  format.coding.colorspace = V4L2_COLORSPACE_RAW;  // codes are linear light
  return format;
}

CameraPicture unpacked(const RawFormat& format, const Bytes& bytes) {
  CameraPicture picture;
  EXPECT_TRUE(PixelUnpacker(format, "test").unpack(bytes, picture));
  EXPECT_EQ(picture.width, format.width);
  EXPECT_EQ(picture.height, format.height);
  return picture;
}

float light_at(const CameraPicture& picture, int x, int y, int channel) {
  const int place = (y * picture.width + x) * picture.channels + channel;
  return picture.light.at(static_cast<size_t>(place));
}

TEST(Grey, CodesAreLinearLight) {
  const CameraPicture picture = unpacked(format_of(V4L2_PIX_FMT_GREY, 2, 2), {0, 51, 102, 255});
  EXPECT_EQ(picture.channels, 1);
  EXPECT_THAT(picture.light, testing::Pointwise(testing::FloatNear(1e-6F),
                                                std::vector<float>{0.0F, 0.2F, 0.4F, 1.0F}));
}

TEST(Grey, PaddingOfRowsIsSkippedAndTheLastNeedsNone) {
  const RawFormat format = format_of(V4L2_PIX_FMT_GREY, 2, 2, 5);
  const Bytes bytes{255, 0, 99, 99, 99, 0, 255};
  EXPECT_THAT(unpacked(format, bytes).light, testing::ElementsAre(1.0F, 0.0F, 0.0F, 1.0F));
  CameraPicture picture;
  EXPECT_FALSE(PixelUnpacker(format, "test").unpack({bytes.data(), 6}, picture));
}

TEST(Grey, WideSamplesAreLittleEndian) {
  const Bytes ten{0xFF, 0x03, 0x00, 0x02};
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_Y10, 2, 1), ten).light[0], 1.0, 1e-6);
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_Y10, 2, 1), ten).light[1], 512.0 / 1023.0, 1e-6);
  const Bytes sixteen{0xFF, 0xFF, 0x34, 0x12};
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_Y16, 2, 1), sixteen).light[0], 1.0, 1e-6);
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_Y16, 2, 1), sixteen).light[1], 0x1234 / 65535.0,
              1e-6);
}

TEST(Grey, IsFullRangeIfTheDriverStatesNothing) {
  RawFormat format = format_of(V4L2_PIX_FMT_GREY, 3, 1);
  format.coding = {};
  EXPECT_THAT(
      unpacked(format, {0, 16, 255}).light,
      testing::Pointwise(testing::FloatNear(1e-4F), std::vector<float>{0.0F, 0.0052F, 1.0F}));
}

TEST(Grey, LimitedRangeHasItsBlackAndWhite) {
  RawFormat format = format_of(V4L2_PIX_FMT_GREY, 4, 1);
  format.coding.quantization = V4L2_QUANTIZATION_LIM_RANGE;
  const CameraPicture picture = unpacked(format, {3, 16, 235, 250});
  EXPECT_THAT(picture.light, testing::ElementsAre(0.0F, 0.0F, 1.0F, 1.0F));
  format.fourcc = V4L2_PIX_FMT_Y10;
  format.width = 2;
  const CameraPicture wide = unpacked(format, {0x40, 0x00, 0xAC, 0x03});
  EXPECT_NEAR(wide.light[0], 0.0, 1e-6);
  EXPECT_NEAR(wide.light[1], 1.0, 1e-6);
}

TEST(Rgb, BytesAreInTheFormatsOrder) {
  const Bytes bytes{255, 51, 0};
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_RGB24, 1, 1), bytes).light[0], 1.0, 1e-6);
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_RGB24, 1, 1), bytes).light[1], 0.2, 1e-6);
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_BGR24, 1, 1), bytes).light[0], 0.0, 1e-6);
  EXPECT_NEAR(unpacked(format_of(V4L2_PIX_FMT_BGR24, 1, 1), bytes).light[2], 1.0, 1e-6);
}

TEST(Rgb, TheTransferFunctionIsInverted) {
  RawFormat format = format_of(V4L2_PIX_FMT_RGB24, 1, 1);
  format.coding.colorspace = V4L2_COLORSPACE_SRGB;
  EXPECT_NEAR(unpacked(format, {188, 0, 255}).light[0], 0.5029, 1e-4);
}

// Encodes by the standards' definition: luma is a weighted sum, chroma is the difference from luma.
struct Encoder {
  double red_weight;
  double blue_weight;
  bool full;

  [[nodiscard]] std::array<uint8_t, 3> operator()(const Colour& rgb) const {
    const double luma =
        red_weight * rgb[0] + blue_weight * rgb[2] + (1.0 - red_weight - blue_weight) * rgb[1];
    const double blue = (rgb[2] - luma) / (2.0 * (1.0 - blue_weight));
    const double red = (rgb[0] - luma) / (2.0 * (1.0 - red_weight));
    const auto code = [](double value) { return static_cast<uint8_t>(std::lround(value)); };
    if (full)
      return {code(255.0 * luma), code(std::min(128.0 + 255.0 * blue, 255.0)),
              code(std::min(128.0 + 255.0 * red, 255.0))};
    return {code(16.0 + 219.0 * luma), code(128.0 + 224.0 * blue), code(128.0 + 224.0 * red)};
  }
};

const std::vector<Colour> kColours{{0, 0, 0},       {1, 1, 1},       {1, 0, 0},
                                   {0, 1, 0},       {0, 0, 1},       {0.5, 0.5, 0.5},
                                   {0.9, 0.3, 0.1}, {0.1, 0.4, 0.8}, {0.2, 0.9, 0.6}};

/// Returns a picture of a single colour.
Bytes picture_of(uint32_t fourcc, const std::array<uint8_t, 3>& code) {
  const auto [y, cb, cr] = code;
  if (fourcc == V4L2_PIX_FMT_YUYV) return {y, cb, y, cr};
  if (fourcc == V4L2_PIX_FMT_UYVY) return {cb, y, cr, y};
  return {y, y, cb, cr};
}

TEST(Ycbcr, EveryEncodingIsDecodedExactly) {
  const std::pair<uint32_t, Encoder> encodings[] = {
      {V4L2_YCBCR_ENC_601, {0.299, 0.114, false}},
      {V4L2_YCBCR_ENC_709, {0.2126, 0.0722, false}},
      {V4L2_YCBCR_ENC_BT2020, {0.2627, 0.0593, false}},
      {V4L2_YCBCR_ENC_SMPTE240M, {0.212, 0.087, false}},
  };
  for (const uint32_t fourcc : {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_NV12})
    for (auto [encoding, encoder] : encodings)
      for (const bool full : {false, true})
        for (const Colour& colour : kColours) {
          RawFormat format = format_of(fourcc, 2, 1);
          format.coding.ycbcr_enc = encoding;
          format.coding.quantization =
              full ? V4L2_QUANTIZATION_FULL_RANGE : V4L2_QUANTIZATION_LIM_RANGE;
          encoder.full = full;
          const CameraPicture picture = unpacked(format, picture_of(fourcc, encoder(colour)));
          for (int channel = 0; channel < 3; ++channel)
            for (int x = 0; x < 2; ++x)
              ASSERT_NEAR(light_at(picture, x, 0, channel), colour[static_cast<size_t>(channel)],
                          0.01)
                  << fourcc_name(fourcc) << " encoding " << encoding << " full " << full;
        }
}

TEST(Ycbcr, OddSizesHaveHalfAPair) {
  EXPECT_EQ(PixelUnpacker(format_of(V4L2_PIX_FMT_YUYV, 3, 1), "test").bytes_needed(), 8U);
  const CameraPicture odd =
      unpacked(format_of(V4L2_PIX_FMT_YUYV, 3, 1), {10, 128, 20, 128, 255, 128, 0, 128});
  EXPECT_NEAR(light_at(odd, 1, 0, 1), 20.0 / 255.0, 1e-6);
  EXPECT_NEAR(light_at(odd, 2, 0, 1), 1.0, 1e-6);
  // 3x3: rows of 4 with padding, then two rows of Cb and Cr.
  Bytes planes(20, 128);
  planes[2 * 4 + 2] = 255;
  EXPECT_EQ(PixelUnpacker(format_of(V4L2_PIX_FMT_NV12, 3, 3), "test").bytes_needed(), 20U);
  EXPECT_NEAR(light_at(unpacked(format_of(V4L2_PIX_FMT_NV12, 3, 3), planes), 2, 2, 0), 1.0, 1e-6);
}

TEST(Ycbcr, Nv12SharesColoursAmongFour) {
  Bytes planes(16, 128);
  planes.resize(24, 128);
  planes[16 + 4 + 2 + 1] = 255;  // Cr of the four pixels at the lower right
  const CameraPicture picture = unpacked(format_of(V4L2_PIX_FMT_NV12, 4, 4), planes);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x)
      EXPECT_EQ(light_at(picture, x, y, 0) > 0.9F, x >= 2 && y >= 2) << x << " " << y;
}

struct BayerCase {
  uint32_t fourcc;
  int red_column;
  int red_row;
};

constexpr BayerCase kBayer[] = {{V4L2_PIX_FMT_SRGGB8, 0, 0},
                                {V4L2_PIX_FMT_SGRBG8, 1, 0},
                                {V4L2_PIX_FMT_SGBRG8, 0, 1},
                                {V4L2_PIX_FMT_SBGGR8, 1, 1}};

int filter_at(const BayerCase& order, int x, int y) {
  const bool red_column = x % 2 == order.red_column;
  const bool red_row = y % 2 == order.red_row;
  if (red_column != red_row) return 1;
  return red_row ? 0 : 2;
}

template <typename Code>
Bytes mosaic(const BayerCase& order, int width, int height, Code code) {
  Bytes bytes;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      bytes.push_back(static_cast<uint8_t>(code(x, y, filter_at(order, x, y))));
  return bytes;
}

TEST(Bayer, AUniformColourStaysUniformUpToTheEdges) {
  const int codes[] = {200, 100, 50};
  for (const BayerCase& order : kBayer)
    for (const auto& [width, height] : {std::pair{2, 2}, {3, 5}, {8, 6}}) {
      const Bytes bytes = mosaic(order, width, height, [&](int, int, int c) { return codes[c]; });
      const CameraPicture picture = unpacked(format_of(order.fourcc, width, height), bytes);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          for (int channel = 0; channel < 3; ++channel)
            ASSERT_NEAR(light_at(picture, x, y, channel), codes[channel] / 255.0, 1e-6)
                << fourcc_name(order.fourcc) << " " << x << " " << y;
    }
}

TEST(Bayer, RampsStayLinearInside) {
  const auto ramp = [](int x, int y, int channel) { return 20 + 7 * x + 5 * y + 30 * channel; };
  for (const BayerCase& order : kBayer) {
    const CameraPicture picture =
        unpacked(format_of(order.fourcc, 9, 8), mosaic(order, 9, 8, ramp));
    for (int y = 1; y < 7; ++y)
      for (int x = 1; x < 8; ++x)
        for (int channel = 0; channel < 3; ++channel)
          ASSERT_NEAR(light_at(picture, x, y, channel), ramp(x, y, channel) / 255.0, 1e-6)
              << fourcc_name(order.fourcc) << " " << x << " " << y << " " << channel;
  }
}

class Jpeg : public testing::Test {
 protected:
  static constexpr int kWidth = 48;
  static constexpr int kHeight = 32;

  /// Makes a smooth picture with some structure, so that a cut anywhere loses information.
  Jpeg() {
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        for (const int value : {5 * x, 7 * y, 128 + 40 * ((x / 8 + y / 8) % 2)})
          rgb_.push_back(static_cast<uint8_t>(std::min(value, 255)));
    jpeg_ = compressed(TJSAMP_444);
  }
  Bytes compressed(int subsampling) {
    const tjhandle handle = tjInitCompress();
    unsigned char* buffer = nullptr;
    unsigned long size = 0;
    EXPECT_EQ(tjCompress2(handle, rgb_.data(), kWidth, 0, kHeight, TJPF_RGB, &buffer, &size,
                          subsampling, 98, 0),
              0);
    Bytes bytes(buffer, buffer + size);
    tjFree(buffer);
    tjDestroy(handle);
    return bytes;
  }
  static bool accepts(const Bytes& bytes, int width = kWidth, int height = kHeight) {
    CameraPicture picture;
    return PixelUnpacker(format_of(V4L2_PIX_FMT_MJPEG, width, height), "test")
        .unpack(bytes, picture);
  }
  Bytes rgb_;
  Bytes jpeg_;
};

TEST_F(Jpeg, DecodesThePicture) {
  const CameraPicture picture = unpacked(format_of(V4L2_PIX_FMT_MJPEG, kWidth, kHeight), jpeg_);
  ASSERT_EQ(picture.light.size(), rgb_.size());
  for (size_t i = 0; i < rgb_.size(); ++i)
    ASSERT_NEAR(picture.light[i], rgb_[i] / 255.0, 0.02) << i;
}

TEST_F(Jpeg, OfOneChannelIsGreyInAllThree) {
  const CameraPicture picture =
      unpacked(format_of(V4L2_PIX_FMT_MJPEG, kWidth, kHeight), compressed(TJSAMP_GRAY));
  EXPECT_EQ(picture.channels, 3);
  EXPECT_EQ(light_at(picture, 5, 5, 0), light_at(picture, 5, 5, 2));
}

TEST_F(Jpeg, TruncatedAnywhereIsDamaged) {
  for (size_t size = 0; size < jpeg_.size(); size += 7)
    EXPECT_FALSE(accepts({jpeg_.begin(), jpeg_.begin() + static_cast<long>(size)})) << size;
  EXPECT_FALSE(accepts({jpeg_.begin(), jpeg_.end() - 2})) << "no end marker";
}

TEST_F(Jpeg, TruncatedWithAnEndMarkerIsDamaged) {
  Bytes bytes(jpeg_.begin(), jpeg_.begin() + static_cast<long>(jpeg_.size() * 3 / 4));
  bytes.insert(bytes.end(), {0xFF, 0xD9});
  EXPECT_FALSE(accepts(bytes));
}

TEST_F(Jpeg, BytesAroundTheEndMarkerAreIgnored) {
  Bytes bytes = jpeg_;
  bytes.insert(bytes.end() - 2, 60, 0x17);  // more than the decoder has read ahead
  EXPECT_TRUE(accepts(bytes));
  bytes.insert(bytes.end(), 100, 0);  // driver buffers have spare bytes after the picture
  EXPECT_TRUE(accepts(bytes));
}

TEST_F(Jpeg, OfAnotherSizeIsDamaged) {
  EXPECT_FALSE(accepts(jpeg_, kWidth, kHeight - 1));
  EXPECT_FALSE(accepts(jpeg_, kWidth * 2, kHeight));
}

TEST_F(Jpeg, GarbageDoesNotAffectTheNextPicture) {
  PixelUnpacker unpacker(format_of(V4L2_PIX_FMT_MJPEG, kWidth, kHeight), "test");
  std::mt19937 random(1);
  CameraPicture picture;
  for (int i = 0; i < 200; ++i) {
    Bytes bytes(random() % 500);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    if (bytes.size() > 4 && i % 2 == 0) std::copy_n(jpeg_.begin(), 4, bytes.begin());
    EXPECT_FALSE(unpacker.unpack(bytes, picture));
  }
  EXPECT_TRUE(unpacker.unpack(jpeg_, picture));
}

TEST(Unpacking, RefusesUnsupportedFormats) {
  const RawFormat refused[] = {
      format_of(v4l2_fourcc('H', '2', '6', '4'), 8, 8),
      format_of(V4L2_PIX_FMT_GREY, 0, 8),
      format_of(V4L2_PIX_FMT_GREY, 8, -1),
      format_of(V4L2_PIX_FMT_GREY, 16385, 1),
      format_of(V4L2_PIX_FMT_GREY, 16384, 16384),
      format_of(V4L2_PIX_FMT_SRGGB8, 1, 8),
      format_of(V4L2_PIX_FMT_YUYV, 8, 8, 15),
      format_of(V4L2_PIX_FMT_GREY, 8, 8, size_t{1} << 40),
  };
  for (const RawFormat& format : refused) {
    const Error error = test::error_of([&] { PixelUnpacker(format, "/dev/video7"); });
    EXPECT_EQ(error.kind(), ErrorKind::Device);
    EXPECT_THAT(error.what(), testing::StartsWith("/dev/video7: "));
    EXPECT_FALSE(error.hint().empty());
  }
}

TEST(Unpacking, NeverReadsPastTheEnd) {
  for (const PixelLayout& layout : kLayouts) {
    if (layout.packing == Packing::Jpeg) continue;
    PixelUnpacker unpacker(format_of(layout.fourcc, 5, 3), "test");
    CameraPicture picture;
    const Bytes enough(unpacker.bytes_needed(),
                       77);  // the address sanitizer finds reads beyond the end
    EXPECT_TRUE(unpacker.unpack(enough, picture)) << fourcc_name(layout.fourcc);
    const Bytes too_few(unpacker.bytes_needed() - 1, 77);
    EXPECT_FALSE(unpacker.unpack(too_few, picture)) << fourcc_name(layout.fourcc);
  }
}

TEST(Unpacking, ReusesThePicture) {
  PixelUnpacker unpacker(format_of(V4L2_PIX_FMT_GREY, 4, 4), "test");
  CameraPicture picture;
  picture.light.resize(100);
  const float* const memory = picture.light.data();
  EXPECT_TRUE(unpacker.unpack(Bytes(16, 9), picture));
  EXPECT_EQ(picture.light.size(), 16U);
  EXPECT_EQ(picture.light.data(), memory);
}

TEST(Names, OfPixelFormatsAreThoseOfTheKernel) {
  EXPECT_EQ(fourcc_name(V4L2_PIX_FMT_YUYV), "YUYV");
  EXPECT_EQ(fourcc_name(V4L2_PIX_FMT_Y16), "Y16");
  EXPECT_EQ(fourcc_name(0x00000007), "0x00000007");
  EXPECT_EQ(layout_named("MJPG")->fourcc, V4L2_PIX_FMT_MJPEG);
  EXPECT_EQ(layout_named("H264"), nullptr);
  for (const PixelLayout& layout : kLayouts)
    EXPECT_EQ(layout_named(fourcc_name(layout.fourcc)), layout_of(layout.fourcc));
}

}  // namespace
}  // namespace lenticule::calib
