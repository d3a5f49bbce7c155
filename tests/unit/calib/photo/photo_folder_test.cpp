// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/photo_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "frames/image_io.h"
#include "frames/srgb.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::calib {
namespace {

using test::error_of;
using test::ScratchFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Writes a picture of a single code.
void write_plain(const std::filesystem::path& file, uint8_t code, int width = 4, int height = 3) {
  frames::WovenFrame frame({width, height, frames::PixelFormat::Rgb8});
  std::fill(frame.bytes().begin(), frame.bytes().end(), code);
  frames::write_woven(frame.view(), file);
}

std::vector<std::string> names(const PhotoFolder& photos) {
  std::vector<std::string> out;
  for (const auto& file : photos.files()) out.push_back(file.filename().string());
  return out;
}

TEST(PhotoFolder, ReturnsPicturesInOrderAndThenEnds) {
  const ScratchFolder folder;
  write_plain(folder / "p10.png", 255);
  write_plain(folder / "p9.png", 128);
  write_plain(folder / "p100.exr", 0);
  std::ofstream(folder / "notes.txt") << "not a photograph";
  std::ofstream(folder / "._p1.png") << "what other systems leave behind";
  std::filesystem::create_directory(folder / "p5.png");
  PhotoFolder photos(folder.path(), 3);
  EXPECT_THAT(names(photos), ElementsAre("p9.png", "p10.png", "p100.exr"));
  EXPECT_EQ(photos.facts().width, 4);
  EXPECT_EQ(photos.facts().height, 3);
  EXPECT_EQ(photos.facts().pixel_format, "photographs");
  const double lights[] = {frames::linear_of_codes()[128], 1.0, 0.0};
  CameraPicture picture;
  for (uint64_t i = 0; i < 3; ++i) {
    const Nanoseconds before = photos.now();
    ASSERT_EQ(photos.grab(picture, Nanoseconds(0)), GrabStatus::Ready);
    EXPECT_EQ(picture.sequence, i);
    EXPECT_EQ(picture.time, before);
    ASSERT_EQ(picture.light.size(), 4U * 3U * 3U);
    for (const float light : picture.light) EXPECT_NEAR(light, lights[i], 1e-5);
  }
  EXPECT_EQ(photos.grab(picture, Nanoseconds(0)), GrabStatus::Gone);
  EXPECT_THAT(photos.failure(), HasSubstr("only 3 photographs"));
  EXPECT_EQ(photos.grab(picture, Nanoseconds(0)), GrabStatus::Gone);
}

TEST(PhotoFolder, ReportsMissingPhotographs) {
  const ScratchFolder folder;
  Error error = error_of([&] { PhotoFolder(folder / "none", 1); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), HasSubstr("cannot read the folder"));
  error = error_of([&] { PhotoFolder(folder.path(), 0); });
  EXPECT_THAT(error.what(), HasSubstr("0 photographs"));
  write_plain(folder / "a.png", 1);
  error = error_of([&] { PhotoFolder(folder.path(), 36); });
  EXPECT_THAT(error.what(), HasSubstr("1 photographs, but 36 are needed"));
}

TEST(PhotoFolder, AllPhotographsHaveOneSize) {
  const ScratchFolder folder;
  write_plain(folder / "a.png", 1);
  write_plain(folder / "b.png", 1, 3, 4);
  test::expect_error(error_of([&] { PhotoFolder(folder.path(), 2); }), ErrorKind::Input,
                     "b.png: 3 x 4 pixels where the first photograph has 4 x 3");
}

TEST(PhotoFolder, ABrokenPhotographIsNamed) {
  const ScratchFolder folder;
  std::ofstream(folder / "a.png") << "not a picture";
  EXPECT_THAT(error_of([&] { PhotoFolder(folder.path(), 1); }).what(), HasSubstr("a.png"));
}

TEST(PhotoFolder, AChangedFolderIsAnError) {
  const ScratchFolder folder;
  for (const char* change : {"gone", "other size", "no picture"}) {
    write_plain(folder / "a.png", 1);
    PhotoFolder photos(folder.path(), 1);
    if (std::string(change) == "gone") std::filesystem::remove(folder / "a.png");
    if (std::string(change) == "other size") write_plain(folder / "a.png", 1, 8, 8);
    if (std::string(change) == "no picture") std::ofstream(folder / "a.png") << "x";
    CameraPicture picture;
    EXPECT_EQ(photos.grab(picture, Nanoseconds(0)), GrabStatus::Gone) << change;
    EXPECT_THAT(photos.failure(), HasSubstr("a.png")) << change;
  }
}

}  // namespace
}  // namespace lenticule::calib
