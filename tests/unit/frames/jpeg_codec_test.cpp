// SPDX-License-Identifier: Apache-2.0
// Tests that JPEGs are decoded as OpenImageIO does, without it.
#include <gmock/gmock.h>

#include <optional>

#include "frames/picture_codec.h"
#include "tests/support/error_matchers.h"
#include "tests/support/jpeg_maker.h"

namespace lenticule::frames {
namespace {

using test::exif_of;
using test::jpeg_of;
using test::JpegKind;

struct Decoded final : PictureSink {
  void accept(const PictureInfo& header) override {
    info = header;
    pixels.resize(size_t(info.geometry.width) * size_t(info.geometry.height) * info.pixel_bytes);
  }
  std::span<uint8_t> rows(int y, int rows) override {
    const size_t row = size_t(info.geometry.width) * info.pixel_bytes;
    return std::span(pixels).subspan(row * size_t(y), row * size_t(rows));
  }
  PictureInfo info;
  std::vector<uint8_t> pixels;
};

Decoded decoded_by(const PictureDecoder& codec, const std::vector<uint8_t>& bytes,
                   PictureValues values = PictureValues::Codes) {
  Decoded out;
  codec.decode(bytes, "a.jpg", values, out);
  return out;
}

const PictureDecoder& open_image_io() { return picture_codec(ImageFormat::Jpeg); }

const PictureDecoder& built_in(const std::vector<uint8_t>& bytes) {
  const PictureDecoder* const codec = built_in_codec(bytes, "a.jpg");
  EXPECT_NE(codec, nullptr) << "OpenImageIO would decode it";
  return codec != nullptr ? *codec : open_image_io();
}

void expect_same(const std::vector<uint8_t>& bytes) {
  const PictureDecoder& codec = built_in(bytes);
  for (const auto values : {PictureValues::Codes, PictureValues::Colours, PictureValues::Data}) {
    const Decoded ours = decoded_by(codec, bytes, values);
    const Decoded theirs = decoded_by(open_image_io(), bytes, values);
    EXPECT_EQ(ours.info, theirs.info);
    EXPECT_TRUE(ours.pixels == theirs.pixels);
  }
  EXPECT_EQ(codec.probe(bytes, "a.jpg"), open_image_io().probe(bytes, "a.jpg"));
}

TEST(JpegCodec, PixelsOfEveryKindAreThoseOfOpenImageIo) {
  for (const bool progressive : {false, true})
    for (const auto& [across, down] : {std::pair{1, 1}, {2, 1}, {1, 2}, {2, 2}, {4, 1}})
      for (const auto& [width, height] : {std::pair{1, 1}, {17, 9}, {64, 48}, {333, 101}}) {
        SCOPED_TRACE(testing::Message() << progressive << across << down << ' ' << width);
        expect_same(
            jpeg_of(width, height, {.across = across, .down = down, .progressive = progressive}));
      }
  expect_same(jpeg_of(50, 30, {.pixels = JCS_GRAYSCALE, .stored = JCS_GRAYSCALE}));
  expect_same(
      jpeg_of(50, 30, {.pixels = JCS_GRAYSCALE, .stored = JCS_GRAYSCALE, .progressive = true}));
  expect_same(jpeg_of(50, 30, {.stored = JCS_RGB}));
  expect_same(jpeg_of(50, 90, {.across = 2, .down = 2, .restart_rows = 1}));
}

TEST(JpegCodec, OrientationAndPixelAspectAreThoseOfOpenImageIo) {
  for (uint8_t orientation = 0; orientation < 10; ++orientation)
    for (const bool big_endian : {false, true})
      expect_same(jpeg_of(16, 8, {.exif = exif_of(orientation, 7200, 7200, big_endian)}));
  expect_same(jpeg_of(16, 8, {.exif = exif_of(1, 7200, 3600)}));
  expect_same(jpeg_of(16, 8, {.exif = exif_of(1, 0, 3600)}));
  expect_same(jpeg_of(16, 8, {.exif = exif_of(1, 65535, 1)}));
  expect_same(jpeg_of(16, 8, {.x_density = 72, .y_density = 144}));
  expect_same(jpeg_of(16, 8, {.x_density = 72, .y_density = 144, .exif = exif_of(6, 100, 300)}));
  const Decoded wide =
      decoded_by(built_in(jpeg_of(16, 8)), jpeg_of(16, 8, {.x_density = 72, .y_density = 144}));
  EXPECT_EQ(wide.info.pixel_aspect, 2.0);
}

TEST(JpegCodec, UnusualPicturesAreLeftToOpenImageIo) {
  EXPECT_NE(built_in_codec(jpeg_of(16, 8), "a.jpg"), nullptr);
  EXPECT_EQ(built_in_codec(jpeg_of(16, 8), "a.MPO"), nullptr);
  for (const JpegKind& kind :
       std::initializer_list<JpegKind>{{.pixels = JCS_CMYK, .stored = JCS_CMYK},
                                       {.pixels = JCS_CMYK, .stored = JCS_YCCK},
                                       {.arithmetic = true},
                                       {.x_density = 2, .y_density = 1}}) {
    const auto bytes = jpeg_of(16, 8, kind);
    EXPECT_EQ(built_in_codec(bytes, "a.jpg"), nullptr);
    EXPECT_EQ(decoded_by(picture_codec(bytes, "a.jpg"), bytes).pixels.size(), 16U * 8 * 3);
  }
}

/// Returns the name and the first word of the cause; nothing without an error.
std::string beginning_of_error(const PictureDecoder& codec, const std::vector<uint8_t>& bytes) {
  try {
    (void)decoded_by(codec, bytes);
    return {};
  } catch (const Error& error) {
    return std::string(error.what()).substr(0, 16);
  }
}

TEST(JpegCodec, APictureCutAnywhereIsAnErrorOfTheFile) {
  for (const bool progressive : {false, true}) {
    const auto whole = jpeg_of(40, 24, {.across = 2, .down = 2, .progressive = progressive});
    for (size_t size = 0; size + 2 < whole.size(); ++size) {
      std::vector<uint8_t> cut(whole.begin(), whole.begin() + std::ptrdiff_t(size));
      for (const bool ends : {false, true}) {
        if (ends) cut.insert(cut.end(), {0xFF, 0xD9});
        const PictureDecoder* const codec = built_in_codec(cut, "a.jpg");
        if (codec == nullptr) continue;  // the header is cut
        // To both, a progressive picture is complete without its last scans.
        EXPECT_EQ(beginning_of_error(*codec, cut), beginning_of_error(open_image_io(), cut))
            << size << ends;
      }
    }
  }
}

TEST(JpegCodec, DamagedBytesGiveTheirPixelsOrAnError) {
  for (const bool progressive : {false, true}) {
    const auto whole =
        jpeg_of(24, 24, {.across = 2, .down = 2, .progressive = progressive, .exif = exif_of(6)});
    for (size_t at = 2; at < whole.size(); ++at)
      for (const int flip : {1, 64, 255}) {
        auto bytes = whole;
        bytes[at] ^= static_cast<uint8_t>(flip);
        const PictureDecoder* const codec = built_in_codec(bytes, "a.jpg");
        if (codec == nullptr) continue;
        try {
          const Decoded ours = decoded_by(*codec, bytes);
          EXPECT_TRUE(ours.pixels == decoded_by(open_image_io(), bytes).pixels) << at;
        } catch (const Error& error) {
          EXPECT_EQ(error.kind(), ErrorKind::Input) << error.what();
        }
      }
  }
}

TEST(JpegCodec, ASizeThatTheBytesCannotHoldIsRefusedByTheHeader) {
  auto bytes = jpeg_of(16, 8, {.progressive = true});
  size_t frame = 0;  // the marker of the frame, which states the size
  while (bytes[frame] != 0xFF || bytes[frame + 1] != 0xC2) ++frame;
  const auto refused = [&](uint8_t high) {
    for (const size_t at : {frame + 5, frame + 7}) bytes[at] = high;
    Decoded out;
    const auto error = test::error_of([&] { built_in(bytes).decode(bytes, "a.jpg", {}, out); });
    EXPECT_TRUE(out.pixels.empty());
    return std::string(error.what());
  };
  EXPECT_THAT(refused(0x20), testing::StartsWith("a.jpg: truncated"));
  EXPECT_THAT(refused(0xF0), testing::HasSubstr("the limit is 32768 per side"));
}

}  // namespace
}  // namespace lenticule::frames
