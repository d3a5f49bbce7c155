// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/exif.h"

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "frames/image_io.h"
#include "tests/support/jpeg_maker.h"

namespace lenticule::calib {
namespace {

/// Returns the beginning of a JPEG file that states 26 mm, in little-endian EXIF.
std::vector<uint8_t> stating_26_mm() {
  return {0xff, 0xd8, 0xff, 0xe1, 0,    52, 'E', 'x', 'i', 'f', 0,  0,  'I', 'I', 42, 0, 8, 0, 0,
          0,    1,    0,    0x69, 0x87, 4,  0,   1,   0,   0,   0,  26, 0,   0,   0,  0, 0, 0, 0,
          1,    0,    0x05, 0xa4, 3,    0,  1,   0,   0,   0,   26, 0,  0,   0,   0,  0, 0, 0};
}

TEST(Exif, ReadsTheFocalLengthOn35mmFilm) {
  const std::vector<uint8_t> jpeg = stating_26_mm();
  EXPECT_EQ(stated_focal_35mm(std::span<const uint8_t>(jpeg)), 26.0);
}

TEST(Exif, EveryTruncatedFileStatesNothingOrTheSame) {
  const std::vector<uint8_t> jpeg = stating_26_mm();
  for (size_t length = 0; length < jpeg.size(); ++length) {
    const auto stated = stated_focal_35mm(std::span<const uint8_t>(jpeg.data(), length));
    if (stated) EXPECT_EQ(*stated, 26.0);
  }
  EXPECT_FALSE(stated_focal_35mm(std::span<const uint8_t>(jpeg.data(), 20)));
}

// Kinds of files whose coded pixels are cut in different ways.
TEST(Exif, AnAnonymousPhotographHasTheSamePixelsAndNothingElse) {
  for (const test::JpegKind& kind :
       {test::JpegKind{.exif = test::exif_of(6)},
        test::JpegKind{.across = 2, .down = 2, .progressive = true, .exif = test::exif_of(3)},
        test::JpegKind{.pixels = JCS_GRAYSCALE, .stored = JCS_GRAYSCALE},
        test::JpegKind{.pixels = JCS_CMYK, .stored = JCS_YCCK},
        test::JpegKind{.restart_rows = 1}}) {
    std::vector<uint8_t> jpeg = test::jpeg_of(40, 24, kind);
    const std::string place = "51 degrees north", owner = "a name";
    for (const int marker : {0xe1, 0xed, 0xfe}) {
      std::vector<uint8_t> segment = {0xff, static_cast<uint8_t>(marker), 0,
                                      static_cast<uint8_t>(2 + place.size())};
      segment.insert(segment.end(), place.begin(), place.end());
      jpeg.insert(jpeg.end() - 2, segment.begin(), segment.end());
      jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
    }
    jpeg.insert(jpeg.end(), owner.begin(), owner.end());
    const std::vector<uint8_t> bare = anonymous_jpeg(jpeg);
    const std::string text(bare.begin(), bare.end());
    EXPECT_EQ(text.find(place), std::string::npos);
    EXPECT_EQ(text.find(owner), std::string::npos);
    EXPECT_EQ(anonymous_jpeg(bare), bare);
    const auto pixels = [](const std::vector<uint8_t>& bytes) {
      const frames::TextureImage image = frames::read_texture(bytes, "photograph.jpg");
      return std::tuple(image.width, image.height, image.codes, image.rgba);
    };
    EXPECT_EQ(pixels(bare), pixels(jpeg));
  }
  const std::vector<uint8_t> stating = stating_26_mm();
  const std::vector<uint8_t> bare = anonymous_jpeg(stating);
  EXPECT_EQ(stated_focal_35mm(std::span<const uint8_t>(bare)), 26.0);
  EXPECT_TRUE(anonymous_jpeg(std::vector<uint8_t>{'n', 'o', 'n', 'e'}).empty());
}

TEST(Exif, AMissingFileStatesNothing) {
  EXPECT_FALSE(stated_focal_35mm(std::filesystem::path("/nowhere/a.jpg")));
}

}  // namespace
}  // namespace lenticule::calib
