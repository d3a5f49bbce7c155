// SPDX-License-Identifier: Apache-2.0
// Tests that pictures are read with the file's exact code values, or refused as a whole.
#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <string_view>

#include "frames/image_io.h"
#include "frames/picture_codec.h"
#include "frames/srgb.h"
#include "heif_maker.h"
#include "png_maker.h"
#include "tests/support/error_matchers.h"
#include "tests/support/gif_maker.h"
#include "tests/support/noise_frame.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using test::PngColour;
using test::PngMaker;
using test::ScratchFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class ImageRead : public ::testing::Test {
 protected:
  WovenFrame read(const std::vector<uint8_t>& bytes, const std::string& name = "picture.png") {
    test::write_bytes(folder_ / name, bytes);
    return read_woven(folder_ / name);
  }
  std::vector<uint8_t> codes(const std::vector<uint8_t>& bytes) {
    const WovenFrame frame = read(bytes);
    return {frame.bytes().begin(), frame.bytes().end()};
  }

  ScratchFolder folder_;
};

TEST_F(ImageRead, GreyIsRepeated) {
  EXPECT_THAT(codes(PngMaker(2, 1, 8, PngColour::Grey).rows({0, 7, 200}).finish()),
              ElementsAre(7, 7, 7, 200, 200, 200));
}

TEST_F(ImageRead, AlphaIsDroppedWithoutPremultiplying) {
  EXPECT_THAT(
      codes(PngMaker(2, 1, 8, PngColour::Rgba).rows({0, 10, 20, 30, 0, 40, 50, 60, 128}).finish()),
      ElementsAre(10, 20, 30, 40, 50, 60));
  EXPECT_THAT(codes(PngMaker(2, 1, 8, PngColour::GreyAlpha).rows({0, 9, 0, 99, 1}).finish()),
              ElementsAre(9, 9, 9, 99, 99, 99));
}

TEST_F(ImageRead, PaletteIsLookedUp) {
  EXPECT_THAT(codes(PngMaker(3, 1, 8, PngColour::Palette)
                        .chunk("PLTE", {1, 2, 3, 101, 102, 103})
                        .rows({0, 1, 0, 1})
                        .finish()),
              ElementsAre(101, 102, 103, 1, 2, 3, 101, 102, 103));
}

TEST_F(ImageRead, TransparentPaletteKeepsItsColours) {
  EXPECT_THAT(codes(PngMaker(2, 1, 8, PngColour::Palette)
                        .chunk("PLTE", {1, 2, 3, 101, 102, 103})
                        .chunk("tRNS", {0, 128})
                        .rows({0, 1, 0})
                        .finish()),
              ElementsAre(101, 102, 103, 1, 2, 3));
}

TEST_F(ImageRead, AGifOfOnePictureIsReadAndOneOfSeveralIsAFilm) {
  const WovenFrame still = read(test::gif_of(1), "a.gif");
  EXPECT_THAT(std::vector<uint8_t>(still.bytes().begin(), still.bytes().end()),
              ElementsAre(255, 0, 0));
  EXPECT_THAT(error_of([&] { (void)read(test::gif_of(2), "a.gif"); }).what(),
              HasSubstr("a.gif: a film, not a picture"));
  std::vector<uint8_t> cut = test::gif_of(1);
  for (; !cut.empty(); cut.pop_back())
    if (cut.back() != ';') EXPECT_THROW((void)read(cut, "a.gif"), Error) << cut.size();
}

TEST_F(ImageRead, OneBitGreyIsBlackAndWhite) {
  EXPECT_THAT(codes(PngMaker(2, 1, 1, PngColour::Grey).rows({0, 0x40}).finish()),
              ElementsAre(0, 0, 0, 255, 255, 255));
}

TEST_F(ImageRead, SixteenBitsRoundToTheNearestCode) {
  // 257 * code is exact; values up to 128 larger still round to the same code.
  EXPECT_THAT(codes(PngMaker(5, 1, 16, PngColour::Grey)
                        .rows({0, 0, 0, 0, 128, 0, 129, 0xFF, 0x7F, 0xFF, 0xFF})
                        .finish()),
              ElementsAre(0, 0, 0, 0, 0, 0, 1, 1, 1, 255, 255, 255, 255, 255, 255));
}

TEST_F(ImageRead, ColourChunksDoNotChangeCodes) {
  const std::vector<uint8_t> row = {0, 10, 20, 30, 200, 210, 220};
  EXPECT_THAT(codes(PngMaker(2, 1, 8, PngColour::Rgb)
                        .chunk("gAMA", {0, 1, 0x86, 0xA0})  // 1.0
                        .chunk("sBIT", {5, 6, 5})
                        .chunk("bKGD", {0, 9, 0, 9, 0, 9})
                        .rows(row)
                        .finish()),
              ElementsAre(10, 20, 30, 200, 210, 220));
  EXPECT_THAT(codes(PngMaker(2, 1, 8, PngColour::Rgb).chunk("sRGB", {0}).rows(row).finish()),
              ElementsAre(10, 20, 30, 200, 210, 220));
}

TEST_F(ImageRead, InterlacedPngIsRead) {
  // Passes 1, 4 and 6 of Adam7 have pixels of a picture of 3 x 1 (columns 0, 2 and 1).
  EXPECT_THAT(codes(PngMaker(3, 1, 8, PngColour::Rgb, true)
                        .rows({0, 1, 2, 3, 0, 7, 8, 9, 0, 4, 5, 6})
                        .finish()),
              ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
}

TEST_F(ImageRead, PngStatesOrientationAndPixelAspect) {
  // Two pixels across for each one down: a pixel is twice as high as wide, which ppu_y / ppu_x
  // says.
  const std::vector<uint8_t> exif = {'M',  'M',  0, 42, 0, 0, 0, 8, 0, 1,  // one tag
                                     0x01, 0x12, 0, 3,  0, 0, 0, 1, 0, 6, 0, 0, 0, 0, 0, 0};
  test::write_bytes(folder_ / "p.png", PngMaker(2, 1, 8, PngColour::Grey)
                                           .chunk("pHYs", {0, 0, 0, 2, 0, 0, 0, 1, 0})
                                           .chunk("eXIf", exif)
                                           .rows({0, 1, 2})
                                           .finish());
  const PictureInfo info = probe_picture(folder_ / "p.png", PictureUse::Views);
  EXPECT_EQ(info.orientation, Orientation::QuarterTurn);
  EXPECT_DOUBLE_EQ(info.pixel_aspect, 0.5);
  EXPECT_THAT(error_of([&] { (void)read_woven(folder_ / "p.png"); }).what(),
              HasSubstr("orientation tag is 6"));
}

TEST_F(ImageRead, TransparencyOfAColourBecomesAlphaOfTextures) {
  const TextureImage image = read_texture(PngMaker(2, 1, 8, PngColour::Rgb)
                                              .chunk("tRNS", {0, 4, 0, 5, 0, 6})
                                              .rows({0, 1, 2, 3, 4, 5, 6})
                                              .finish(),
                                          "embedded");
  EXPECT_THAT(image.codes, ElementsAre(1, 2, 3, 255, 4, 5, 6, 0));
}

TEST_F(ImageRead, PngCutAnywhereIsAnError) {
  const auto file = PngMaker(3, 2, 8, PngColour::Rgb)
                        .rows({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9})
                        .finish();
  ASSERT_EQ(read(file).row(1)[8], 9);
  for (size_t size = 0; size < file.size(); ++size) {
    SCOPED_TRACE(size);
    const Error error = error_of([&] {
      read({file.begin(), file.begin() + std::ptrdiff_t(size)});
    });
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    EXPECT_THAT(error.what(), HasSubstr("picture.png: "));
  }
}

TEST_F(ImageRead, PngWithFewerRowsThanItsHeaderSaysIsAnError) {
  const auto file = PngMaker(3, 2, 8, PngColour::Rgb).rows({0, 1, 2, 3, 4, 5, 6, 7, 8, 9}).finish();
  EXPECT_EQ(error_of([&] { read(file); }).kind(), ErrorKind::Input);
}

TEST_F(ImageRead, PngWithAFlippedBitIsAnErrorOrUnchanged) {
  const auto good = PngMaker(2, 1, 8, PngColour::Rgb).rows({0, 10, 20, 30, 200, 210, 220}).finish();
  const auto expected = codes(good);
  for (size_t bit = 0; bit < good.size() * 8; ++bit) {
    auto file = good;
    file[bit / 8] = static_cast<uint8_t>(file[bit / 8] ^ (1u << (bit % 8)));
    try {
      EXPECT_EQ(codes(file), expected) << "bit " << bit;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
    }
  }
}

class ImageCut : public ImageRead, public ::testing::WithParamInterface<const char*> {};

TEST_P(ImageCut, AnywhereIsAnErrorOrKeepsThePixels) {
  const auto whole = folder_ / (std::string("whole") + GetParam());
  write_woven(test::noise_frame(5, 4, 1).view(), whole);
  const auto file = test::read_bytes(whole);
  ASSERT_EQ(read(file, whole.filename().string()).width(), 5);
  for (size_t size = 0; size < file.size(); ++size) {
    SCOPED_TRACE(size);
    try {
      // A format may end with redundant bytes; if they are cut, the pixels must be right.
      const auto frame = read({file.begin(), file.begin() + std::ptrdiff_t(size)},
                              std::string("cut") + GetParam());
      EXPECT_EQ(frame, test::noise_frame(5, 4, 1));
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Formats, ImageCut, ::testing::Values(".png", ".tif", ".exr", ".ppm"));

/// Returns the smallest baseline JPEG: 8 pixels wide and grey, with the data of one block: of the
/// code 128, or of 144.
std::vector<uint8_t> jpeg_of_one_block(uint8_t stated_height, bool brighter = false) {
  std::vector<uint8_t> file = {0xFF, 0xD8, 0xFF, 0xDB, 0, 67, 0};
  file.insert(file.end(), 64, 1);
  // Two Huffman tables of one code each: lengths of the codes (1 + 15 zeros), then the symbol 0.
  const std::vector<uint8_t> rest = {0xFF, 0xC0, 0,    11,   8,    0,    stated_height,
                                     0,    8,    1,    1,    0x11, 0,    0xFF,
                                     0xC4, 0,    20,   0x00, 1,    0,    0,
                                     0,    0,    0,    0,    0,    0,    0,
                                     0,    0,    0,    0,    0,    0,    0,
                                     0xFF, 0xC4, 0,    20,   0x10, 1,    0,
                                     0,    0,    0,    0,    0,    0,    0,
                                     0,    0,    0,    0,    0,    0,    0,
                                     0,    0xFF, 0xDA, 0,    8,    1,    1,
                                     0,    0,    63,   0,    0x3F, 0xFF, 0xD9};
  file.insert(file.end(), rest.begin(), rest.end());
  if (brighter) {
    constexpr size_t kSymbol = 105;  // of the first table: seven bits of value follow its code
    file[kSymbol] = 7;
    file[file.size() - 3] = 0x7F;
    file.insert(file.end() - 2, 0x7F);
  }
  return file;
}

/// Joins two JPEGs as 3-D cameras do: an index in the first one tells where the second one begins.
std::vector<uint8_t> pair_of_jpegs(std::vector<uint8_t> first, const std::vector<uint8_t>& second,
                                   uint8_t kind = 2) {
  const auto size = static_cast<uint8_t>(first.size() + 66);
  const std::vector<uint8_t> index = {0xFF,
                                      0xE2,
                                      0,
                                      64,
                                      'M',
                                      'P',
                                      'F',
                                      0,
                                      'I',
                                      'I',
                                      '*',
                                      0,
                                      8,
                                      0,
                                      0,
                                      0,  //
                                      1,
                                      0,
                                      0x02,
                                      0xB0,
                                      7,
                                      0,
                                      32,
                                      0,
                                      0,
                                      0,
                                      26,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,  //
                                      kind,
                                      0,
                                      2,
                                      0x20,
                                      size,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,  //
                                      kind,
                                      0,
                                      2,
                                      0,
                                      static_cast<uint8_t>(second.size()),
                                      0,
                                      0,
                                      0,  //
                                      static_cast<uint8_t>(size - 10),
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0,
                                      0};
  first.insert(first.begin() + 2, index.begin(), index.end());
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

TEST_F(ImageRead, TwoEyesInOneFileAreSideBySide) {
  const auto left = jpeg_of_one_block(8), right = jpeg_of_one_block(8, true);
  const WovenFrame pair = read(pair_of_jpegs(left, right), "pair.mpo");
  ASSERT_EQ(pair.geometry(), (FrameGeometry{.width = 16, .height = 8}));
  for (const int x : {0, 7}) EXPECT_EQ(pair.row(7)[3 * x], 128);
  for (const int x : {8, 15}) EXPECT_EQ(pair.row(7)[3 * x], 144);
  EXPECT_TRUE(probe_picture(folder_ / "pair.mpo", PictureUse::Views).two_eyes);
  EXPECT_EQ(read(pair_of_jpegs(left, right, 1), "preview.mpo").width(), 8) << "a smaller copy";
  const Error error = error_of([&] { read(pair_of_jpegs(left, jpeg_of_one_block(16)), "a.mpo"); });
  EXPECT_THAT(error.what(), HasSubstr("two eyes' pictures differ in size"));
}

TEST_F(ImageRead, TwoEyesOfOtherKindsOfIndexNeverCrash) {
  const auto file = pair_of_jpegs(jpeg_of_one_block(8), jpeg_of_one_block(8, true));
  for (size_t at = 2; at < 68; ++at)
    for (const uint8_t value : {uint8_t{0}, uint8_t{0x7F}, uint8_t{0xFF}}) {
      auto damaged = file;
      damaged[at] = value;
      try {
        EXPECT_EQ(read(damaged, "damaged.mpo").height(), 8);
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::Input);
      }
    }
}

TEST_F(ImageRead, TheDisplayWindowOfAnExrIsRead) {
  const std::filesystem::path file = folder_ / "window.exr";
  const WovenFrame inside = test::noise_frame(5, 4, 1);
  write_woven(inside.view(), file);
  auto bytes = test::read_bytes(file);
  constexpr std::string_view kName("displayWindow\0box2i\0\x10\0\0\0", 24);
  const auto at = std::search(bytes.begin(), bytes.end(), kName.begin(), kName.end());
  ASSERT_NE(at, bytes.end());
  // The window is from (-1, -2) to (5, 1): a column more at each side, two rows more above and two
  // fewer below.
  const std::array<int32_t, 4> window = {-1, -2, 5, 1};
  std::memcpy(&*at + kName.size(), window.data(), sizeof window);
  const WovenFrame shown = read(bytes, "window.exr");
  ASSERT_EQ(shown.geometry(), (FrameGeometry{.width = 7, .height = 4}));
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 7; ++x)
      for (int c = 0; c < 3; ++c) {
        const bool stored = y >= 2 && x >= 1 && x <= 5;
        ASSERT_EQ(shown.row(y)[3 * x + c], stored ? inside.row(y - 2)[3 * (x - 1) + c] : 0)
            << x << ' ' << y;
      }
}

TEST_F(ImageRead, PlanarTiffIsRead) {
  // One strip for each colour, in PackBits: before each row of two bytes, the length less one.
  constexpr uint8_t kRows = 130;
  std::vector<uint8_t> file = {'I', 'I', '*', 0, 0, 0, 0, 0};
  const auto add = [&](uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) file.push_back(static_cast<uint8_t>(value >> 8 * i));
  };
  constexpr uint32_t kStripBytes = 3 * kRows;
  for (uint8_t colour = 0; colour < 3; ++colour)
    for (uint8_t row = 0; row < kRows; ++row)
      file.insert(file.end(), {1, row, static_cast<uint8_t>(100 + colour)});
  const auto bits = static_cast<uint32_t>(file.size());
  for (int colour = 0; colour < 3; ++colour) add(8, 2);
  const auto offsets = static_cast<uint32_t>(file.size());
  for (const uint32_t colour : {0U, 1U, 2U}) add(8 + colour * kStripBytes, 4);
  const auto counts = static_cast<uint32_t>(file.size());
  for (int colour = 0; colour < 3; ++colour) add(kStripBytes, 4);
  file[4] = static_cast<uint8_t>(file.size() & 0xFF);
  file[5] = static_cast<uint8_t>(file.size() >> 8);
  constexpr uint32_t kShort = 3, kLong = 4;
  const std::array<std::array<uint32_t, 4>, 10> fields = {{{256, kShort, 1, 2},
                                                           {257, kShort, 1, kRows},
                                                           {258, kShort, 3, bits},
                                                           {259, kShort, 1, 32773},
                                                           {262, kShort, 1, 2},
                                                           {273, kLong, 3, offsets},
                                                           {277, kShort, 1, 3},
                                                           {278, kShort, 1, kRows},
                                                           {279, kLong, 3, counts},
                                                           {284, kShort, 1, 2}}};
  add(fields.size(), 2);
  for (const auto& [tag, type, count, value] : fields) {
    add(tag, 2);
    add(type, 2);
    add(count, 4);
    add(value, 4);
  }
  add(0, 4);
  const WovenFrame frame = read(file, "planar.tif");
  ASSERT_EQ(frame.geometry(), (FrameGeometry{.width = 2, .height = kRows}));
  for (uint8_t row = 0; row < kRows; ++row)
    EXPECT_THAT(std::span(frame.row(row), 6), ElementsAre(row, row, row, 100, 101, 102));
}

TEST_F(ImageRead, BothViewsOfAnExrAreSideBySide) {
  // Two views in one part, the default one without a name, and two parts.
  const float left = static_cast<float>(linear_of_codes()[50]);
  const float right = static_cast<float>(linear_of_codes()[90]);
  const auto expect_pair = [&](const std::filesystem::path& file) {
    const WovenFrame pair = read_woven(file);
    ASSERT_EQ(pair.geometry(), (FrameGeometry{.width = 4, .height = 2})) << file;
    for (int x = 0; x < 4; ++x) EXPECT_EQ(pair.row(1)[3 * x + 2], x < 2 ? 50 : 90) << file;
    EXPECT_TRUE(probe_picture(file, PictureUse::Views).two_eyes);
  };
  for (const bool named : {false, true}) {
    OIIO::ImageSpec spec(2, 2, 6, OIIO::TypeDesc::FLOAT);
    const std::string view = named ? "left." : "";
    spec.channelnames = {view + "R", view + "G", view + "B", "right.R", "right.G", "right.B"};
    std::vector<float> values;
    for (int pixel = 0; pixel < 4; ++pixel)
      values.insert(values.end(), {left, left, left, right, right, right});
    const std::filesystem::path file = folder_ / (named ? "named.exr" : "default.exr");
    const auto output = OIIO::ImageOutput::create("openexr");
    ASSERT_TRUE(output->open(file.string(), spec) &&
                output->write_image(OIIO::TypeDesc::FLOAT, values.data()) && output->close());
    expect_pair(file);
  }
  // The parts may have one channel, behind a part of colours with primaries of their own.
  const std::array wide = {0.708F, 0.292F, 0.17F, 0.797F, 0.131F, 0.046F, 0.3127F, 0.329F};
  for (const int channels : {3, 1}) {
    std::vector<OIIO::ImageSpec> parts(3, OIIO::ImageSpec(2, 2, channels, OIIO::TypeDesc::FLOAT));
    parts[0] = OIIO::ImageSpec(2, 2, 3, OIIO::TypeDesc::FLOAT);
    const std::array<const char*, 3> views = {"middle", "right", "left"};
    for (size_t part = 0; part < parts.size(); ++part) {
      parts[part].attribute("oiio:subimagename", views.at(part));
      parts[part].attribute("view", views.at(part));
      parts[part].attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8),
                            wide.data());
    }
    const std::filesystem::path file = folder_ / ("parts" + std::to_string(channels) + ".exr");
    const auto output = OIIO::ImageOutput::create("openexr");
    ASSERT_TRUE(output->open(file.string(), 3, parts.data()));
    for (size_t part = 0; part < parts.size(); ++part) {
      const bool opened =
          part == 0 || output->open(file.string(), parts[part], OIIO::ImageOutput::AppendSubimage);
      ASSERT_TRUE(opened);
      const std::vector<float> values(12, part == 1 ? right : left);
      ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, values.data()));
    }
    ASSERT_TRUE(output->close());
    expect_pair(file);
  }
}

TEST_F(ImageRead, HeicAndAvifAreReadWithoutTheirAlpha) {
  const WovenFrame picture = test::grey_squares(48, 32, 40);
  for (const auto format : {heif_compression_HEVC, heif_compression_AV1}) {
    test::expect_similar(read(test::heif_of({picture}, format), "photo.heic"), 0, picture);
    EXPECT_FALSE(probe_picture(folder_ / "photo.heic").two_eyes);
    const auto veiled = test::heif_of({picture}, format, 128);
    test::expect_similar(read(veiled, "veiled.heic"), 0, picture);
    const TextureImage texture = read_texture(veiled, "embedded");
    ASSERT_EQ(texture.codes.size(), size_t{48 * 32 * 4});
    EXPECT_NEAR(texture.codes[3], 128, 3);
  }
}

TEST_F(ImageRead, TheEyesOfASpatialPhotographAreSideBySide) {
  const WovenFrame first = test::grey_squares(48, 32, 40), second = test::grey_squares(48, 32, 120);
  const auto both = test::heif_of({first, second});
  const auto items = test::items_of(both);
  EXPECT_EQ(read(both, "album.heic").width(), 48) << "two pictures that are no pair";
  const WovenFrame pair = read(test::with_eyes(both, items[0], items[1]), "pair.heic");
  ASSERT_EQ(pair.width(), 96);
  test::expect_similar(pair, 0, first);
  test::expect_similar(pair, 48, second);
  EXPECT_TRUE(probe_picture(folder_ / "pair.heic", PictureUse::Views).two_eyes);
  const WovenFrame swapped = read(test::with_eyes(both, items[1], items[0]), "swapped.heic");
  test::expect_similar(swapped, 0, second);
  test::expect_similar(swapped, 48, first);
}

TEST_F(ImageRead, DamagedHeicIsAnErrorOrAPicture) {
  const auto both =
      test::heif_of({test::grey_squares(48, 32, 40), test::grey_squares(48, 32, 120)});
  const auto items = test::items_of(both);
  auto file = test::with_eyes(both, items[0], items[1]);
  const auto try_to_read = [&](const std::vector<uint8_t>& bytes) {
    try {
      EXPECT_EQ(read(bytes, "damaged.heic").height(), 32);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
      EXPECT_THAT(error.what(), HasSubstr("damaged.heic"));
    }
  };
  EXPECT_THAT(error_of([&] { read(test::with_eyes(both, items[0], 77), "no-item.heic"); }).what(),
              HasSubstr("truncated or damaged: "));
  for (size_t size = 12; size < file.size(); size += 7)
    EXPECT_EQ(error_of([&] {
                read({file.begin(), file.begin() + std::ptrdiff_t(size)}, "cut.heic");
              }).kind(),
              ErrorKind::Input)
        << size;
  const size_t group = test::HeifBoxes(file).find("grpl");
  for (size_t at = group; at < group + 36; ++at)
    for (const uint8_t value : {uint8_t{0}, uint8_t{1}, uint8_t{0x7F}, uint8_t{0xFF}}) {
      auto damaged = file;
      damaged[at] = value;
      try_to_read(damaged);
    }
  for (size_t at = 0; at < file.size(); at += 11) {
    auto damaged = file;
    damaged[at] ^= 0x55;
    damaged[8] = 'h';
    try_to_read(damaged);
  }
}

TEST_F(ImageRead, ColoursOfOtherPrimariesBecomeThoseOfSrgb) {
  const auto read_exr = [&](const std::vector<float>& chromaticities, const char* name) {
    OIIO::ImageSpec spec(3, 1, 3, OIIO::TypeDesc::FLOAT);
    spec.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8),
                   chromaticities.data());
    const std::vector<float> values = {0.25F, 0.25F, 0.25F, 0.0F, 0.5F, 0.0F, 0.8F, 0.2F, 0.1F};
    const auto output = OIIO::ImageOutput::create("openexr");
    EXPECT_TRUE(output->open((folder_ / name).string(), spec) &&
                output->write_image(OIIO::TypeDesc::FLOAT, values.data()) && output->close());
    return read_texture(folder_ / name).rgba;
  };
  const std::vector<float> same =
      read_exr({0.64F, 0.33F, 0.3F, 0.6F, 0.15F, 0.06F, 0.3127F, 0.329F}, "srgb.exr");
  EXPECT_FLOAT_EQ(same[5], 0.5F);
  EXPECT_FLOAT_EQ(same[4], 0.0F);
  // BT.2020; the expected values are those of ITU-R BT.2087.
  const std::vector<float> wide =
      read_exr({0.708F, 0.292F, 0.17F, 0.797F, 0.131F, 0.046F, 0.3127F, 0.329F}, "wide.exr");
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(wide[c], 0.25, 1e-5) << "grey remains grey";
  EXPECT_NEAR(wide[4], 0.5 * -0.58764, 2e-3);
  EXPECT_NEAR(wide[5], 0.5 * 1.13290, 2e-3);
  EXPECT_NEAR(wide[6], 0.5 * -0.10058, 2e-3);
  EXPECT_NEAR(wide[8], 0.8 * 1.66049 + 0.2 * -0.58764 + 0.1 * -0.07285, 2e-3);
  const std::vector<float> impossible = read_exr({0, 0, 0, 0, 0, 0, 0, 0}, "zero.exr");
  EXPECT_FLOAT_EQ(impossible[5], 0.5F);
  const TextureImage data = read_texture(folder_ / "wide.exr", TextureContent::Data);
  EXPECT_FLOAT_EQ(data.rgba[4], 0.0F) << "normals and the like are no colours";
}

TEST_F(ImageRead, JpegWithoutItsEndIsAnError) {
  const std::vector<uint8_t> file = jpeg_of_one_block(8);
  EXPECT_EQ(read(file, "grey.jpg").row(7)[0], 128);
  for (size_t size = 0; size < file.size(); ++size) {
    SCOPED_TRACE(size);
    EXPECT_EQ(error_of([&] {
                read({file.begin(), file.begin() + std::ptrdiff_t(size)}, "grey.jpg");
              }).kind(),
              ErrorKind::Input);
  }
}

TEST_F(ImageRead, JpegWithLessDataThanItsHeaderStatesIsAnError) {
  for (const uint8_t height : {uint8_t{16}, uint8_t{64}, uint8_t{255}}) {
    const Error error = error_of([&] { read(jpeg_of_one_block(height), "grey.jpg"); });
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    EXPECT_THAT(error.what(), HasSubstr("grey.jpg: truncated or damaged: JPEG error: Corrupt"));
  }
}

TEST_F(ImageRead, JpegWithBytesBetweenItsDataAndItsEndIsRead) {
  std::vector<uint8_t> file = jpeg_of_one_block(8);
  file.insert(file.end() - 2, 60, 0x17);
  EXPECT_EQ(read(file, "grey.jpg").row(7)[0], 128);
}

TEST_F(ImageRead, TooManyPixelsAreRefusedByTheHeader) {
  // The files are headers only: decoding is impossible, so the size must be checked before.
  const auto refuse = [&](uint32_t width, uint32_t height) {
    const auto file = PngMaker(width, height, 8, PngColour::Rgb).rows({0, 0, 0, 0}).finish();
    return std::string(error_of([&] { read(file); }).what());
  };
  EXPECT_THAT(refuse(32769, 1), HasSubstr("the limit is 32768 per side"));
  EXPECT_THAT(refuse(1, 32769), HasSubstr("the limit is 32768 per side"));
  EXPECT_THAT(refuse(32768, 32768), HasSubstr("the limit is 256 million"));
  EXPECT_THAT(refuse(16384, 16384), HasSubstr("truncated"));
  EXPECT_THAT(refuse(0xFFFFFFFF, 0xFFFFFFFF), HasSubstr("picture.png"));
  EXPECT_THAT(refuse(0, 1), HasSubstr("picture.png"));
}

TEST_F(ImageRead, RefusesFilesThatAreNotPictures) {
  EXPECT_THAT(error_of([&] { (void)read_woven(folder_ / "none.png"); }).what(),
              HasSubstr("none.png: cannot read: No such file"));
  EXPECT_THAT(error_of([&] { (void)read_woven(folder_.path()); }).what(), HasSubstr("directory"));
  EXPECT_THAT(error_of([&] { (void)read_woven("/dev/zero"); }).what(),
              HasSubstr("not a regular file"));
  EXPECT_THAT(error_of([&] { read({}); }).what(), HasSubstr("empty file"));
  EXPECT_THAT(error_of([&] {
                read({'h', 'e', 'l', 'l', 'o'});
              }).what(),
              HasSubstr("not a picture of a known format"));
  const std::string film = "\x89LTS\r\n\x1a\n", mp4 = std::string(4, '\0') + "ftypisom";
  const auto expect_refused = [&](const std::string& name, const std::string& bytes,
                                  const char* what, const char* remedy) {
    test::expect_error(error_of([&] {
                         read({bytes.begin(), bytes.end()}, name);
                       }),
                       ErrorKind::Input, name + ": " + what, remedy);
  };
  for (const std::string& bytes : {film, mp4})
    expect_refused("film.png", bytes, "a film, not a picture", "lenticule convert");
  expect_refused("model.obj", "v 0 0 0\n", "a model, not a picture", "lenticule render");
  expect_refused("model.png", "glTF\2", "a model, not a picture", "lenticule render");
  expect_refused("scene.blend", "BLENDER-v300", "a scene of Blender", "glTF");
}

TEST_F(ImageRead, TheBytesDecideAndNotTheExtension) {
  const auto file = PngMaker(1, 1, 8, PngColour::Rgb).rows({0, 1, 2, 3}).finish();
  EXPECT_EQ(read(file, "picture.jpg").row(0)[2], 3);
}

TEST_F(ImageRead, ProbeReturnsTheSize) {
  test::write_bytes(folder_ / "p.png",
                    PngMaker(3, 1, 8, PngColour::Grey).rows({0, 1, 2, 3}).finish());
  EXPECT_EQ(probe_image(folder_ / "p.png"), (FrameGeometry{.width = 3, .height = 1}));
}

TEST_F(ImageRead, ReadsIntoAFrameOfTheSameSizeOnly) {
  test::write_bytes(folder_ / "p.png",
                    PngMaker(3, 1, 8, PngColour::Grey).rows({0, 1, 2, 3}).finish());
  WovenFrame right({.width = 3, .height = 1});
  const uint8_t* const pixels = right.row(0);
  read_woven_into(folder_ / "p.png", right);
  EXPECT_EQ(right.row(0), pixels);
  EXPECT_EQ(right.row(0)[8], 3);
  WovenFrame wrong({.width = 1, .height = 3});
  const Error error = error_of([&] { read_woven_into(folder_ / "p.png", wrong); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), HasSubstr("3 x 1 pixels where 1 x 3 are expected"));
}

TEST_F(ImageRead, TextureIsLinearLightWithSeparateAlpha) {
  const TextureImage stored = read_texture(
      PngMaker(1, 2, 8, PngColour::Rgba).rows({0, 255, 128, 0, 51, 0, 0, 0, 0, 255}).finish(),
      "embedded");
  EXPECT_THAT(stored.codes, ElementsAre(255, 128, 0, 51, 0, 0, 0, 255));
  EXPECT_TRUE(stored.rgba.empty());
  EXPECT_NEAR(floats_of(stored, TextureContent::Data).rgba[1], 128.0 / 255.0, 1e-7);
  const FloatImage image = floats_of(stored);
  ASSERT_EQ(image.width, 1);
  ASSERT_EQ(image.height, 2);
  EXPECT_FLOAT_EQ(image.rgba[0], 1.0f);
  EXPECT_NEAR(image.rgba[1], 0.215861f, 1e-6);
  EXPECT_FLOAT_EQ(image.rgba[2], 0.0f);
  EXPECT_FLOAT_EQ(image.rgba[3], 0.2f);
  EXPECT_FLOAT_EQ(image.rgba[7], 1.0f);
}

TEST_F(ImageRead, TextureKeeps16Bits) {
  const TextureImage image =
      read_texture(PngMaker(1, 1, 16, PngColour::Grey).rows({0, 0x80, 0x01}).finish(), "embedded");
  EXPECT_NEAR(image.rgba[0], linear_from_srgb(0x8001 / 65535.0), 1e-7);
  EXPECT_EQ(image.rgba[3], 1.0f);
}

/// Gives a picture of more texels than textures have: columns of 0 and 255, below them a row of
/// 255.
class LargePicture final : public PictureFileReader {
 public:
  static constexpr FrameGeometry kSize{.width = 32768, .height = 2049};

  [[nodiscard]] PictureInfo probe(const std::filesystem::path&) const override { return {}; }
  void read(const EncodedPicture&, PictureSink& sink, PictureValues) const override {
    sink.accept({.geometry = kSize, .pixel_bytes = 4});
    std::vector<uint8_t> row(size_t{kSize.width} * 4);
    for (size_t n = 0; n < row.size(); ++n) row[n] = n / 4 % 2 == 1 ? 255 : 0;
    for (int y = 0; y < kSize.height;) {
      const std::span<uint8_t> rows = sink.rows(y, kSize.height - y);
      for (size_t at = 0; at < rows.size(); at += row.size(), ++y) {
        if (y + 1 == kSize.height) row.assign(row.size(), 255);
        std::memcpy(rows.data() + at, row.data(), row.size());
      }
    }
  }
};

TEST_F(ImageRead, ALargeTextureIsReducedByMeansOfItsLight) {
  const LargePicture large;
  use_picture_reader(&large);
  const TextureImage colour = read_texture("any.png");
  const TextureImage data = read_texture("any.png", TextureContent::Data);
  use_picture_reader(nullptr);
  EXPECT_EQ(colour.reduced, 2);
  EXPECT_EQ(colour.width, 16384);
  EXPECT_EQ(colour.height, 1025);
  ASSERT_EQ(colour.codes.size(), size_t{16384} * 1025 * 4);
  const size_t last = size_t{16384} * 1024 * 4;
  for (const size_t texel : {size_t{0}, size_t{4} * 16383, last - 4}) {
    EXPECT_EQ(colour.codes[texel], 188) << "half the light";
    EXPECT_EQ(colour.codes[texel + 3], 128) << "half the alpha";
    EXPECT_EQ(data.codes.at(texel), 128) << "the mean of data";
  }
  EXPECT_EQ(colour.codes[last], 255) << "of the last row alone";
  EXPECT_EQ(colour.codes.back(), 255);
}

TEST_F(ImageRead, ATextureMayBeAsLargeAsOtherPictures) {
  const auto refuse = [](uint32_t width, uint32_t height) {
    const auto file = PngMaker(width, height, 8, PngColour::Rgb).rows({0, 0, 0, 0}).finish();
    return std::string(error_of([&] { (void)read_texture(file, "a.png"); }).what());
  };
  EXPECT_THAT(refuse(16384, 16384), HasSubstr("truncated"));
  EXPECT_THAT(refuse(32768, 32768), HasSubstr("the limit is 256 million"));
}

TEST_F(ImageRead, DamagedTextureIsNamed) {
  const std::vector<uint8_t> nonsense = {1, 2, 3};
  EXPECT_THAT(error_of([&] { (void)read_texture(nonsense, "scene.gltf: image 3"); }).what(),
              HasSubstr("scene.gltf: image 3"));
}

}  // namespace
}  // namespace lenticule::frames
