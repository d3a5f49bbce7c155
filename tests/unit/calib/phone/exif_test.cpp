// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/exif.h"

#include <gtest/gtest.h>

#include <vector>

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

TEST(Exif, AMissingFileStatesNothing) {
  EXPECT_FALSE(stated_focal_35mm(std::filesystem::path("/nowhere/a.jpg")));
}

}  // namespace
}  // namespace lenticule::calib
