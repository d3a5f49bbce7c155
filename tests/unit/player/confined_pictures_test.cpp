// SPDX-License-Identifier: Apache-2.0
// Tests pictures that are decoded in confined processes.
#include "player/sources/confined_pictures.h"

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/jpeg_maker.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/frames/heif_maker.h"
#include "tests/unit/frames/png_maker.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

constexpr auto kViews = frames::PictureUse::Views;

/// Collects the rows of one picture.
class Rows final : public frames::PictureSink {
 public:
  void accept(const frames::PictureInfo& info) override {
    frame = frames::WovenFrame(info.geometry);
  }
  std::span<uint8_t> rows(int y, int rows) override {
    const size_t row_bytes = frame.geometry().row_bytes();
    return frame.bytes().subspan(row_bytes * size_t(y), row_bytes * size_t(rows));
  }
  frames::WovenFrame frame;
};

class ConfinedPicturesTest : public test::VideoTest {
 protected:
  void expect_picture() {
    Rows rows;
    pictures_.read(file("good.png"), rows);
    EXPECT_EQ(rows.frame, clip_frame(1));
  }

  void SetUp() override {
    VideoTest::SetUp();
    frames::write_woven(clip_frame(1).view(), file("good.png"));
  }

  ConfinedPictures pictures_{LENTICULE_PICTURES_PROGRAM};
};

TEST_F(ConfinedPicturesTest, OtherFormatsHaveADecoderOfTheirOwn) {
  frames::write_woven(clip_frame(2).view(), file("good.tif"));
  for (int i = 0; i < 2; ++i) {
    expect_picture();
    Rows rows;
    pictures_.read(file("good.tif"), rows);
    EXPECT_EQ(rows.frame, clip_frame(2));
  }
  EXPECT_EQ(pictures_.started(), 2u);
  EXPECT_EQ(pictures_.idle().size(), 2u);
}

TEST_F(ConfinedPicturesTest, UsualJpegsHaveTheDecoderOfPng) {
  test::write_bytes(file("good.jpg"), test::jpeg_of(40, 24, {.exif = test::exif_of(6)}));
  test::write_bytes(file("print.jpg"),
                    test::jpeg_of(40, 24, {.pixels = JCS_CMYK, .stored = JCS_CMYK}));
  expect_picture();
  const auto expect_as_here = [&](const char* name) {
    EXPECT_EQ(pictures_.probe(file(name)), frames::probe_picture(file(name), kViews));
    Rows rows;
    pictures_.read(file(name), rows);
    EXPECT_EQ(rows.frame.width(), 40);
  };
  expect_as_here("good.jpg");
  EXPECT_EQ(pictures_.started(), 1U);
  for (int i = 0; i < 2; ++i) expect_as_here("print.jpg");
  EXPECT_EQ(pictures_.started(), 2U) << "a picture of CMYK ended the decoder that refused it";
  EXPECT_EQ(pictures_.idle().size(), 2U);
  std::filesystem::resize_file(file("good.jpg"), file_size(file("good.jpg")) - 9);
  test::expect_error(test::error_of([&] { (void)pictures_.probe(file("good.jpg")); }),
                     ErrorKind::Input, "good.jpg: truncated");
}

TEST_F(ConfinedPicturesTest, PhotographsOfPhonesAreReadInConfinement) {
  const frames::WovenFrame left = test::grey_squares(640, 480, 0);
  const frames::WovenFrame right = test::grey_squares(640, 480, 60);
  for (const auto format : {heif_compression_HEVC, heif_compression_AV1}) {
    const auto both = test::heif_of({left, right}, format);
    const auto items = test::items_of(both);
    test::write_bytes(file("pair.heic"), test::with_eyes(both, items[0], items[1]));
    EXPECT_TRUE(pictures_.probe(file("pair.heic")).two_eyes);
    Rows rows;
    pictures_.read(file("pair.heic"), rows);
    ASSERT_EQ(rows.frame.width(), 1280);
    test::expect_similar(rows.frame, 0, left);
    test::expect_similar(rows.frame, 640, right);
  }
  EXPECT_EQ(pictures_.started(), 1U) << "none of the files ended its decoder";
}

TEST_F(ConfinedPicturesTest, TheBytesChooseTheDecoderAndNotTheName) {
  frames::write_woven(clip_frame(2).view(), file("good.tif"));
  std::filesystem::rename(file("good.tif"), file("renamed.png"));
  Rows rows;
  pictures_.read(file("renamed.png"), rows);
  EXPECT_EQ(rows.frame, clip_frame(2));
}

TEST_F(ConfinedPicturesTest, StartingADecoderIsNotPartOfAPicturesTime) {
  const ConfinedPictures with_short_limit(LENTICULE_PICTURES_PROGRAM,
                                          {.processor_time = std::chrono::milliseconds(1)});
  Rows rows;
  with_short_limit.read(file("good.png"), rows);
  EXPECT_EQ(rows.frame, clip_frame(1));
}

TEST_F(ConfinedPicturesTest, ADamagedPictureIsNamedAndTheNextOneIsRead) {
  std::filesystem::copy_file(file("good.png"), file("cut.png"));
  std::filesystem::resize_file(file("cut.png"), 500);
  Rows rows;
  test::expect_error(test::error_of([&] { pictures_.read(file("cut.png"), rows); }),
                     ErrorKind::Input, "cut.png: truncated");
  expect_picture();
}

TEST_F(ConfinedPicturesTest, AnIdleDecoderThatWasKilledIsReplaced) {
  for (int i = 0; i < 5; ++i) {
    expect_picture();
    const std::vector<pid_t> idle = pictures_.idle();
    ASSERT_EQ(idle.size(), 1u);
    ASSERT_EQ(::kill(idle.front(), SIGKILL), 0);
    // Without being reaped: only the reader waits for its processes.
    siginfo_t end{};
    ASSERT_EQ(::waitid(P_PID, id_t(idle.front()), &end, WEXITED | WNOWAIT), 0);
  }
  expect_picture();
  EXPECT_EQ(pictures_.started(), 6u);
}

TEST_F(ConfinedPicturesTest, TexturesHaveTheTexelsThatThisProcessWouldDecode) {
  test::write_bytes(file("deep.png"), test::PngMaker(2, 2, 16, test::PngColour::Grey)
                                          .rows({0, 0, 1, 128, 2, 0, 255, 3, 4, 5})
                                          .finish());
  frames::write_woven(clip_frame(2).view(), file("good.tif"));
  frames::write_woven(clip_frame(3).view(), file("light.exr"));
  for (const char* name : {"good.png", "deep.png", "good.tif", "light.exr"})
    for (const auto content : {frames::TextureContent::Colour, frames::TextureContent::Data}) {
      const std::vector<uint8_t> bytes = read_whole_file(file(name), 1 << 20);
      const frames::TextureImage here = frames::read_texture(file(name), content);
      frames::use_picture_reader(&pictures_);
      const frames::TextureImage from_file = frames::read_texture(file(name), content);
      const frames::TextureImage embedded = frames::read_texture(bytes, name, content);
      frames::use_picture_reader(nullptr);
      for (const frames::TextureImage* there : {&from_file, &embedded}) {
        EXPECT_EQ(there->width, here.width) << name;
        EXPECT_EQ(there->height, here.height) << name;
        EXPECT_EQ(there->codes, here.codes) << name;
        EXPECT_EQ(there->rgba, here.rgba) << name;
      }
    }
  EXPECT_EQ(pictures_.started(), 2u) << "textures do not share their decoders";
}

TEST_F(ConfinedPicturesTest, ManyPicturesAtOnceHaveAFewDecoders) {
  std::vector<std::thread> threads;
  std::atomic<int> wrong{0};
  for (int n = 0; n < 24; ++n)
    threads.emplace_back([&] {
      Rows rows;
      pictures_.read(file("good.png"), rows);
      if (rows.frame != clip_frame(1)) ++wrong;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong.load(), 0);
  EXPECT_LE(pictures_.started(), 8u);
}

// The reader is the fake decoder, which does what the text of the file says.
class FaultyDecoderTest : public ConfinedPicturesTest {
 protected:
  Error error_of(const std::string& what) {
    write_text_file(file("picture.tif"), what);
    const auto begin = std::chrono::steady_clock::now();
    const Error error = test::error_of([&] {
      Rows rows;
      faulty_.read(file("picture.tif"), rows);
    });
    EXPECT_LT(std::chrono::steady_clock::now() - begin, test::kVideoDeadline) << what;
    expect_well();
    return error;
  }
  void expect_well() {
    write_text_file(file("well.tif"), "well");
    Rows rows;
    faulty_.read(file("well.tif"), rows);
    EXPECT_THAT(rows.frame.bytes(), testing::ElementsAre(1, 2, 3, 4, 5, 6));
  }

  ConfinedPictures faulty_{LENTICULE_FAKE_PICTURES,
                           {.processor_time = std::chrono::milliseconds(500),
                            .silence = std::chrono::milliseconds(2000)}};
};

TEST_F(FaultyDecoderTest, ADecoderThatEndsOrHangsIsAnErrorOfItsPicture) {
  expect_well();
  struct {
    const char* what;
    const char* message;
  } const kFaults[] = {{"crash", "picture.tif: its decoder was ended by signal 6"},
                       {"leave", "picture.tif: its decoder ended with exit code 0"},
                       {"stop", "picture.tif: its decoder did not respond for 2 s"},
                       {"spin", "picture.tif: not read after"}};
  for (const auto& [what, message] : kFaults)
    test::expect_error(error_of(what), ErrorKind::Input, message, "save it again as PNG");
}

TEST_F(FaultyDecoderTest, ADecoderThatLiesIsAnErrorOfItsPicture) {
  for (const char* lie :
       {"lies about the width", "lies about the area", "lies about the pixels",
        "lies about the aspect", "lies about the orientation", "answers with a number",
        "sends rows first", "sends too many rows", "sends no rows", "sends rows below",
        "sends rows from nowhere", "ends early", "short"}) {
    SCOPED_TRACE(lie);
    test::expect_error(error_of(lie), ErrorKind::Input,
                       "picture.tif: its decoder answered out of order", "save it again as PNG");
  }
}

}  // namespace
}  // namespace lenticule::player
