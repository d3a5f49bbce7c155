// SPDX-License-Identifier: Apache-2.0
// Tests third-party content from the command line to pictures: quilts, stereo pairs, depth, one
// video per view, frames of other rigs. Each is played, woven, converted or refused.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "frames/weaving/fast_weaver.h"
#include "optics/rig_file.h"
#include "tests/commands/program.h"
#include "tests/support/h264_clip.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/frames/heif_maker.h"

namespace lenticule::test {
namespace {

namespace fs = std::filesystem;
using frames::WovenFrame;

const std::string kTiny = source_file("scenes/rigs/tiny.toml");
const std::string kOther = source_file("scenes/rigs/paper-64.toml");

/// Returns a quilt whose tiles differ, smooth enough for chroma of half resolution.
WovenFrame quilt_picture(int columns, int rows, int seed, int tile_width = 12,
                         int tile_height = 8) {
  WovenFrame quilt({.width = columns * tile_width, .height = rows * tile_height});
  for (int y = 0; y < quilt.height(); ++y)
    for (int x = 0; x < quilt.width(); ++x) {
      const int column = x / tile_width, from_bottom = rows - 1 - y / tile_height;
      const int tile = from_bottom * columns + column;
      uint8_t* const rgb = quilt.row(y) + x * 3;
      rgb[0] = static_cast<uint8_t>(30 * tile + seed * 7 + x % tile_width);
      rgb[1] = static_cast<uint8_t>(200 - 30 * tile + seed * 3);
      rgb[2] = static_cast<uint8_t>(40 + 5 * (y % tile_height) + seed * 5);
    }
  return quilt;
}

class ContentCommand : public CommandTest {
 protected:
  std::string save(const std::string& name, const WovenFrame& picture) const {
    frames::write_woven(picture.view(), path(name));
    return path(name);
  }
  static void succeed(const ProcessResult& result) { ASSERT_EQ(result.exit_code, 0) << result.err; }
  [[nodiscard]] static ProcessResult convert(std::vector<std::string> words) {
    words.insert(words.begin(), "convert");
    return run(words);
  }
  /// Returns the displayed frames in order, each once.
  [[nodiscard]] std::vector<WovenFrame> played(const std::string& source,
                                               std::vector<std::string> more = {},
                                               const std::string& rig = kTiny) const {
    fs::remove_all(path("glass"));
    expect_end(run(joined({"play", source, "--rig", rig, "--display", "virtual", "--clock",
                           "simulated", "--record", "png:" + path("glass")},
                          more)),
               0);
    std::map<std::string, WovenFrame> shown;
    if (fs::exists(path("glass")))
      for (const auto& entry : fs::directory_iterator(path("glass")))
        shown[entry.path().filename().string()] = frames::read_woven(entry.path());
    std::vector<WovenFrame> frames;
    for (auto& [name, frame] : shown)
      if (frames.empty() || frames.back() != frame) frames.push_back(std::move(frame));
    return frames;
  }
  [[nodiscard]] static WovenFrame woven(const WovenFrame& quilt, const frames::QuiltLayout& layout,
                                        const frames::WeaveOptions& options = {},
                                        const std::string& rig = kTiny) {
    return frames::weave_fast(frames::ViewSet(quilt, layout),
                              optics::OpticalModel(optics::load_rig(rig)), options);
  }
  [[nodiscard]] WovenFrame woven_by_command(std::vector<std::string> words) const {
    words.insert(words.begin(), "weave");
    words.insert(words.end(), {"--rig", kTiny, "-o", path("woven.png")});
    expect_end(run(words), 0);
    return frames::read_woven(path("woven.png"));
  }
};

constexpr frames::QuiltLayout kGrid{.columns = 3, .rows = 2, .views = 0, .aspect = 1.5};

TEST_F(ContentCommand, AQuiltVideoPlaysLikeItsPictures) {
  std::vector<WovenFrame> expected;
  for (int n = 0; n < 4; ++n) {
    save(fmt::format("p_qs3x2a1.5_{}.png", n), quilt_picture(3, 2, n));
    expected.push_back(woven(quilt_picture(3, 2, n), kGrid));
  }
  EXPECT_EQ(played(path("p_qs3x2a1.5_%d.png")), expected);
  // FFV1 is lossless; the layout becomes part of the file's name.
  succeed(convert({path("p_qs3x2a1.5_%d.png"), "-o", path("film.mkv"), "--rate", "30"}));
  ASSERT_TRUE(fs::exists(path("film_qs3x2a1.5.mkv")));
  EXPECT_EQ(played(path("film_qs3x2a1.5.mkv")), expected);
  EXPECT_EQ(played(path("film_qs3x2a1.5.mkv"), {"--frames", "1:3"}),
            (std::vector<WovenFrame>{expected[1], expected[2]}));
  const auto turned = played(path("film_qs3x2a1.5.mkv"), {"--invert", "--loop", "2"});
  ASSERT_EQ(turned.size(), 8U);
  EXPECT_EQ(turned[7],
            woven(quilt_picture(3, 2, 3), kGrid, {.order = frames::ViewOrder::RightToLeft}));
}

/// Tile t of 3 x 2 has a grey of its own, in Y'CbCr 4:2:0 of limited range.
TEST_F(ContentCommand, AQuiltVideoMayHaveChromaOfHalfResolution) {
  const auto luma = [](int tile) { return 16 + 36 * tile; };
  std::string raw(36 * 16 * 3 / 2, '\x80');
  WovenFrame quilt({.width = 36, .height = 16});
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 36; ++x) {
      const int tile = (y < 8 ? 3 : 0) + x / 12;
      raw[static_cast<size_t>(y * 36 + x)] = static_cast<char>(luma(tile));
      const auto code = static_cast<uint8_t>(std::lround((luma(tile) - 16) * 255.0 / 219.0));
      std::fill_n(quilt.row(y) + x * 3, 3, code);
    }
  write("raw", raw);
  expect_end(run_process({"/bin/sh", "-c",
                          "exec ffmpeg -v error -f rawvideo -pixel_format yuv420p -video_size "
                          "36x16 -framerate 30 -i " +
                              path("raw") + " -vf setparams=range=tv -c:v ffv1 " +
                              path("q_qs3x2a1.5.mkv")}),
             0);
  EXPECT_EQ(played(path("q_qs3x2a1.5.mkv")), std::vector<WovenFrame>{woven(quilt, kGrid)});
}

TEST_F(ContentCommand, AnUprightPanelIsWovenFromAVideoToo) {
  const std::string upright = source_file("scenes/rigs/portrait.toml");
  frames::QuiltLayout layout{.columns = 5, .rows = 3, .views = 13, .aspect = 0.75};
  save("p.png", quilt_picture(5, 3, 1, 12, 16));
  succeed(convert({path("p.png"), "--grid", "5x3", "--views", "13", "--aspect", "0.75", "-o",
                   path("film.mkv")}));
  succeed(convert(
      {path("film_qs5x3a0.75.mkv"), "--rig", upright, "--frames", "0:1", "-o", path("w.png")}));
  EXPECT_EQ(frames::read_woven(path("w.png")),
            woven(quilt_picture(5, 3, 1, 12, 16), layout, {}, upright));
}

TEST_F(ContentCommand, AnIncompleteLastRowSurvivesEveryFormat) {
  save("p_0.png", quilt_picture(3, 2, 0));
  save("p_1.png", quilt_picture(3, 2, 1));
  frames::QuiltLayout five = kGrid;
  five.views = 5;
  std::vector<WovenFrame> expected = {woven(quilt_picture(3, 2, 0), five),
                                      woven(quilt_picture(3, 2, 1), five)};
  const std::vector<std::string> how = {"--grid", "3x2", "--views", "5", "--aspect", "1.5"};
  succeed(convert(joined({path("p_%d.png"), "-o", path("film.lts")}, how)));
  EXPECT_EQ(played(path("film.lts")), expected) << "a container of views";
  succeed(convert({path("film.lts"), "-o", path("again_%d.png")}));
  EXPECT_EQ(played(path("again_%d_qs3x2a1.5.png")), expected) << "the sidecar has the count";
  // Weaving while converting gives the same frames as weaving while playing.
  succeed(convert({path("film.lts"), "--rig", kTiny, "-o", path("w%d.png")}));
  EXPECT_EQ(frames::read_woven(path("w1.png")), expected[1]);
  succeed(convert({path("film.lts"), "--rig", kTiny, "-o", path("woven.lts")}));
  succeed(convert({path("woven.lts"), "-o", path("woven.mkv")}));
  EXPECT_EQ(played(path("woven.mkv")), expected);
}

TEST_F(ContentCommand, ViewsAsPicturesComeBackAsTheSameQuilt) {
  for (int n = 0; n < 3; ++n) save(fmt::format("p_qs3x2a1.5_{}.png", n), quilt_picture(3, 2, n));
  succeed(convert(
      {path("p_qs3x2a1.5_%d.png"), "-o", "views:" + path("view%d/%03d.png"), "--frames", "1:3"}));
  const WovenFrame view = frames::read_woven(path("view4/001.png"));
  EXPECT_EQ(view.row(0)[0], quilt_picture(3, 2, 1).row(0)[12 * 3]) << "upper row, second tile";
  succeed(convert({"views:" + path("view%d/%03d.png"), "-o", path("back_qs3x2a1.5_%d.png")}));
  EXPECT_EQ(frames::read_woven(path("back_qs3x2a1.5_0.png")), quilt_picture(3, 2, 1));
  EXPECT_EQ(frames::read_woven(path("back_qs3x2a1.5_1.png")), quilt_picture(3, 2, 2));
  EXPECT_EQ(played("views:" + path("view%d/%03d.png")),
            (std::vector<WovenFrame>{woven(quilt_picture(3, 2, 1), kGrid),
                                     woven(quilt_picture(3, 2, 2), kGrid)}));
}

/// Returns a picture with red on the left and blue on the right, or red above and blue below.
WovenFrame two_eyes(bool beside) {
  WovenFrame picture({.width = beside ? 96 : 48, .height = beside ? 32 : 64});
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x)
      picture.row(y)[x * 3 + ((beside ? x >= 48 : y >= 32) ? 2 : 0)] = 255;
  return picture;
}

/// Amounts of red and blue that an eye in one half of the lobe sees.
struct Seen {
  double red = 0.0, blue = 0.0;
};
Seen seen_by(const WovenFrame& frame, int eye) {
  const optics::OpticalModel model(optics::load_rig(kTiny));
  const WovenFrame view = frames::decode_view(frame.view(), model, eye, 2);
  Seen seen;
  for (size_t n = 0; n < view.bytes().size(); n += 3) {
    seen.red += view.bytes()[n];
    seen.blue += view.bytes()[n + 2];
  }
  return seen;
}

void expect_red_for_the_left_eye(const WovenFrame& frame) {
  EXPECT_GT(seen_by(frame, 0).red, 4.0 * seen_by(frame, 0).blue);
  EXPECT_GT(seen_by(frame, 1).blue, 4.0 * seen_by(frame, 1).red);
}

TEST_F(ContentCommand, EachEyeSeesItsOwnPictureInEveryStereoLayout) {
  for (const auto& [name, beside] : std::map<std::string, bool>{
           {"a_sbs.png", true}, {"b_hsbs.png", true}, {"c_tb.png", false}, {"d_htb.png", false}}) {
    save(name, two_eyes(beside));
    expect_red_for_the_left_eye(woven_by_command({path(name), "--filter", "nearest"}));
  }
  const auto swapped = woven_by_command({path("c_tb.png"), "--filter", "nearest", "--invert"});
  EXPECT_GT(seen_by(swapped, 0).blue, 4.0 * seen_by(swapped, 0).red);
  save("plain.png", two_eyes(true));
  const auto shown = played(path("plain.png"), {"--filter", "nearest", "--stereo", "sbs"});
  ASSERT_EQ(shown.size(), 1U);
  expect_red_for_the_left_eye(shown[0]);
}

/// Returns a video of uncompressed pictures, each in a stream of its own, as 3-D cameras write it.
std::string avi_of(const std::vector<WovenFrame>& pictures) {
  const auto number = [](uint32_t value, int bytes = 4) {
    std::string text;
    for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> 8 * i);
    return text;
  };
  const auto numbers = [&](const std::vector<uint32_t>& values) {
    std::string text;
    for (const uint32_t value : values) text += number(value);
    return text;
  };
  const auto chunk = [&](const std::string& name, const std::string& data) {
    return name + number(static_cast<uint32_t>(data.size())) + data;
  };
  const auto width = static_cast<uint32_t>(pictures[0].width());
  const auto height = static_cast<uint32_t>(pictures[0].height()), bytes = 3 * width * height;
  const auto streams = static_cast<uint32_t>(pictures.size());
  std::string header =
      chunk("avih", numbers({40000, 0, 0, 0, 1, 0, streams, bytes, width, height, 0, 0, 0, 0}));
  std::string movie;
  for (size_t i = 0; i < pictures.size(); ++i) {
    header += chunk(
        "LIST", "strl" +
                    chunk("strh", "vidsDIB " + numbers({0, 0, 0, 1, 25, 0, 1, bytes, 0, 0, 0, 0})) +
                    chunk("strf", numbers({40, width, height}) + number(1, 2) + number(24, 2) +
                                      numbers({0, bytes, 0, 0, 0, 0})));
    std::string pixels;
    for (int y = pictures[i].height() - 1; y >= 0; --y)
      for (int x = 0; x < pictures[i].width(); ++x)
        for (const int c : {2, 1, 0}) pixels += static_cast<char>(pictures[i].row(y)[3 * x + c]);
    movie += chunk(fmt::format("{:02}db", i), pixels);
  }
  return chunk("RIFF", "AVI " + chunk("LIST", "hdrl" + header) + chunk("LIST", "movi" + movie));
}

WovenFrame of_colour(size_t channel) {
  WovenFrame picture({.width = 48, .height = 32});
  for (size_t n = channel; n < picture.bytes().size(); n += 3) picture.bytes()[n] = 255;
  return picture;
}

TEST_F(ContentCommand, TheStreamsOfAVideoAreTheLeftAndTheRightEye) {
  const std::vector<std::string> flags = {"--filter", "nearest", "--frame", "0"};
  write("camera.avi", avi_of({of_colour(0), of_colour(2)}));
  expect_red_for_the_left_eye(woven_by_command(joined({path("camera.avi")}, flags)));
  write("cross.avi", avi_of({of_colour(2), of_colour(0)}));
  expect_red_for_the_left_eye(woven_by_command(joined({path("cross.avi"), "--invert"}, flags)));
  const auto shown = played(path("camera.avi"), {"--filter", "nearest"});
  ASSERT_EQ(shown.size(), 1U);
  expect_red_for_the_left_eye(shown[0]);
  const auto first = woven_by_command(joined({path("camera.avi"), "--grid", "1x1"}, flags));
  EXPECT_EQ(seen_by(first, 1).blue, 0.0) << "flat: the first stream";
}

/// Returns red and blue beside or above each other, of one size as a whole.
Picture420 coded_eyes(bool beside, bool right_first) {
  constexpr int kWidth = 96, kHeight = 64;
  Picture420 picture{.width = kWidth, .height = kHeight, .samples = {}};
  const auto plane = [&](int scale, uint8_t red, uint8_t blue) {
    for (int y = 0; y < kHeight / scale; ++y)
      for (int x = 0; x < kWidth / scale; ++x) {
        const bool second = beside ? x >= kWidth / scale / 2 : y >= kHeight / scale / 2;
        picture.samples.push_back(second != right_first ? blue : red);
      }
  };
  plane(1, 81, 41);
  plane(2, 90, 240);
  plane(2, 240, 110);
  return picture;
}

TEST_F(ContentCommand, TheStreamItselfMayTellHowTheEyesLie) {
  for (const bool beside : {true, false})
    for (const bool right_first : {true, false}) {
      const H264Clip clip{
          .file = path("film.flv"), .packing = beside ? 3U : 4U, .right_first = right_first};
      write_h264_clip(clip, {coded_eyes(beside, right_first)});
      expect_red_for_the_left_eye(
          woven_by_command({path("film.flv"), "--filter", "nearest", "--frame", "0"}));
      // The tag comes before the name.
      fs::copy_file(path("film.flv"), path("film_rl.flv"), fs::copy_options::overwrite_existing);
      expect_red_for_the_left_eye(
          woven_by_command({path("film_rl.flv"), "--filter", "nearest", "--frame", "0"}));
    }
}

TEST_F(ContentCommand, APhotographForTwoEyesIsTakenForThat) {
  const auto both = heif_of({of_colour(0), of_colour(2)});
  const auto items = items_of(both);
  write_bytes(path("IMG_1.HEIC"), with_eyes(both, items[0], items[1]));
  expect_red_for_the_left_eye(woven_by_command({path("IMG_1.HEIC"), "--filter", "nearest"}));
  // The group names the items: their order in the file does not count.
  const auto reversed = heif_of({of_colour(2), of_colour(0)});
  write_bytes(path("IMG_2.HEIC"), with_eyes(reversed, items[1], items[0]));
  expect_red_for_the_left_eye(woven_by_command({path("IMG_2.HEIC"), "--filter", "nearest"}));
}

/// Returns two views of noise, whose lower half is nearer; or two that have nothing in common.
WovenFrame noise_for_two_eyes(bool related) {
  constexpr int kEye = 320, kHeight = 200, kCell = 4;
  WovenFrame picture({.width = 2 * kEye, .height = kHeight});
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < 2 * kEye; ++x) {
      const int moved = x < kEye ? x : x - kEye + (y < kHeight / 2 ? 4 : 16);
      auto mixed = static_cast<uint32_t>((related ? moved : x) / kCell + 1000 * (y / kCell));
      for (const uint32_t factor : {0x7feb352dU, 0x846ca68bU})
        mixed = (mixed ^ mixed >> 15) * factor;
      std::fill_n(picture.row(y) + 3 * x, 3, static_cast<uint8_t>(mixed >> 24));
    }
  return picture;
}

TEST_F(ContentCommand, TwoEyesAreFoundInThePixelsOfPicturesThatAreNotWoven) {
  save("holiday.png", noise_for_two_eyes(true));
  const ProcessResult shown = run({"play", path("holiday.png"), "--rig", kTiny, "--display",
                                   "virtual", "--clock", "simulated"});
  expect_end(shown, 0);
  EXPECT_THAT(shown.err, testing::HasSubstr("holiday.png: taken for two eyes side by side"));
  EXPECT_THAT(shown.err, testing::HasSubstr("--stereo none"));
  EXPECT_THAT(shown.err, testing::HasSubstr("--stereo sbs --invert"));
  EXPECT_EQ(woven_by_command({path("holiday.png")}),
            woven_by_command({path("holiday.png"), "--stereo", "sbs"}));
  expect_end(run({"play", path("holiday.png"), "--rig", kTiny, "--stereo", "none"}), 4,
             "640x200 pixels");
  // Every command decides alike, and says so once for each file.
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"--rig", kTiny, "-o", path("converted.png")},
        {"--as", "quilt", "-o", path("quilt.png")}}) {
    const ProcessResult converted = convert(joined({path("holiday.png")}, words));
    expect_end(converted, 0);
    EXPECT_THAT(converted.err, testing::HasSubstr("holiday.png: taken for two eyes side by side"));
  }
  EXPECT_EQ(frames::read_woven(path("converted.png")), woven_by_command({path("holiday.png")}));
  write("twice.m3u", "holiday.png\nholiday.png\n");
  const ProcessResult twice = run({"play", path("twice.m3u"), "--rig", kTiny, "--display",
                                   "virtual", "--clock", "simulated", "--loop", "2"});
  expect_end(twice, 0);
  EXPECT_EQ(twice.err.find("taken for two eyes"), twice.err.rfind("taken for two eyes"));
  save("unrelated.png", noise_for_two_eyes(false));
  expect_end(run({"play", path("unrelated.png"), "--rig", kTiny}), 4, "640x200 pixels");
}

TEST_F(ContentCommand, StereoPicturesAreSplitAndJoined) {
  save("c_tb.png", two_eyes(false));
  succeed(convert({path("c_tb.png"), "-o", "views:" + path("eye%d.png")}));
  EXPECT_EQ(frames::read_woven(path("eye0.png")).row(0)[0], 255) << "left is red";
  EXPECT_EQ(frames::read_woven(path("eye1.png")).row(0)[2], 255) << "right is blue";
  expect_red_for_the_left_eye(woven_by_command(
      {"views:" + path("eye0.png") + "|" + path("eye1.png"), "--filter", "nearest"}));
  // The name of the video states a grid.
  succeed(convert({path("c_tb.png"), "-o", path("eyes_qs2x1.mkv")}));
  const auto shown = played(path("eyes_qs2x1.mkv"), {"--filter", "nearest"});
  ASSERT_EQ(shown.size(), 1U);
  expect_red_for_the_left_eye(shown[0]);
}

/// Returns a bright column in the middle of the picture, with its depth map to the right.
WovenFrame column_with_depth(uint8_t depth, uint8_t ground) {
  WovenFrame picture({.width = 96, .height = 32});
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 48; ++x) {
      const bool column = x >= 20 && x < 28;
      std::fill_n(picture.row(y) + x * 3, 3, static_cast<uint8_t>(column ? 255 : 10));
      std::fill_n(picture.row(y) + (x + 48) * 3, 3, column ? depth : ground);
    }
  return picture;
}

/// Returns the centre of brightness of a view's row.
double middle_of_light(const WovenFrame& view) {
  double light = 0.0, moment = 0.0;
  for (int x = 0; x < view.width(); ++x)
    if (view.row(16)[x * 3] > 128) {
      light += 1.0;
      moment += x;
    }
  return light > 0.0 ? moment / light : -1.0;
}

TEST_F(ContentCommand, NearObjectsMoveAgainstTheEyeAndFarOnesWithIt) {
  save("near_rgbd.png", column_with_depth(255, 127));
  const std::vector<std::string> how = {"--views", "5", "--depth-range", "-6px:6px"};
  const auto drawn = [&](const std::string& name, std::vector<std::string> more = {}) {
    succeed(convert(joined(joined({path(name), "-o", "views:" + path("v%d.png")}, how), more)));
    return middle_of_light(frames::read_woven(path("v4.png"))) -
           middle_of_light(frames::read_woven(path("v0.png")));
  };
  EXPECT_NEAR(drawn("near_rgbd.png"), -6.0, 0.6) << "nearer than the panel: to the left";
  save("far_rgbd.png", column_with_depth(0, 0));
  EXPECT_NEAR(drawn("far_rgbd.png"), 6.0, 0.6) << "behind it: to the right";
  EXPECT_NEAR(drawn("far_rgbd.png", {"--invert-depth"}), -6.0, 0.6);
  // Depth in a separate file gives the same result.
  const WovenFrame both = column_with_depth(255, 127);
  WovenFrame colour({.width = 48, .height = 32}), depth({.width = 48, .height = 32});
  for (int y = 0; y < 32; ++y) {
    std::copy_n(both.row(y), 144, colour.row(y));
    std::copy_n(both.row(y) + 144, 144, depth.row(y));
  }
  save("colour.png", colour);
  save("depth.png", depth);
  EXPECT_NEAR(drawn("colour.png", {"--depth", path("depth.png")}), -6.0, 0.6);
  // The player weaves the same views that convert writes.
  succeed(convert({path("near_rgbd.png"), "-o", path("q_qs3x2.png"), "--views", "5"}));
  std::vector<WovenFrame> shown = played(path("near_rgbd.png"), {"--views", "5"});
  ASSERT_EQ(shown.size(), 1U);
  EXPECT_EQ(shown, played(path("q_qs3x2.png"))) << "5 of 6 tiles, as the sidecar says";
}

TEST_F(ContentCommand, TheDepthBudgetCompressesDepthToTheSheetsDepthOfField) {
  save("deep_rgbd.png", column_with_depth(255, 0));
  const double pitch = optics::load_rig(kTiny).sheet.pitch.value;
  const double most = 0.2 * pitch * pitch / 3.0;  // pixels of a view as wide as the panel
  const std::vector<std::string> deep = {path("deep_rgbd.png"), "--depth-range", "-12px:12px"};
  const auto limited = joined(deep, {"--depth-budget", "0.2"});
  const WovenFrame woven =
      woven_by_command({path("deep_rgbd.png"), "--depth-range", fmt::format("-{0}px:{0}px", most)});
  EXPECT_EQ(woven_by_command(limited), woven);
  EXPECT_NE(woven_by_command(deep), woven);
  EXPECT_EQ(woven_by_command(joined(deep, {"--depth-budget", "4"})), woven_by_command(deep));
  EXPECT_EQ(played(path("deep_rgbd.png"), {limited.begin() + 1, limited.end()}),
            std::vector<WovenFrame>{woven});
  succeed(convert(joined(limited, {"--rig", kTiny, "-o", path("converted.png")})));
  EXPECT_EQ(frames::read_woven(path("converted.png")), woven);
  expect_end(convert(joined(limited, {"-o", path("quilt.png")})), 2, "use --depth-range");
}

TEST_F(ContentCommand, TheZeroPlaneMovesStereoInDepth) {
  WovenFrame eyes({.width = 96, .height = 32});  // a column that is 6 pixels in front of the panel
  for (int y = 0; y < 32; ++y)
    for (const int begin : {23, 48 + 17}) std::fill_n(eyes.row(y) + begin * 3, 24, uint8_t{255});
  save("a_sbs.png", eyes);
  const auto disparity = [&](const std::string& zero_plane, int width) {
    succeed(convert({path("a_sbs.png"), "-o", "views:" + path("v%d.png"), "--zero-plane",
                     zero_plane, "--overwrite"}));
    const WovenFrame left = frames::read_woven(path("v0.png"));
    EXPECT_EQ(left.width(), width);
    return middle_of_light(left) - middle_of_light(frames::read_woven(path("v1.png")));
  };
  EXPECT_EQ(disparity("0", 48), 6.0);
  EXPECT_EQ(disparity("6px", 42), 0.0);
  EXPECT_EQ(disparity("12.5", 42), 0.0) << "percent of 48 pixels";
  EXPECT_EQ(disparity("-2px", 46), 8.0);
  expect_end(convert({path("a_sbs.png"), "-o", path("q.png"), "--zero-plane", "100"}), 2,
             "zero plane: 48 pixels, but a view has 48");
}

TEST_F(ContentCommand, SidecarsSupplyTheLayoutThatTheNameLacks) {
  save("city.png", quilt_picture(3, 2, 0));
  write("city.json", R"({"columns": 3, "rows": 2, "viewCount": 5, "aspect": 1.5, "invert": 1})");
  frames::QuiltLayout five = kGrid;
  five.views = 5;
  const WovenFrame expected =
      woven(quilt_picture(3, 2, 0), five, {.order = frames::ViewOrder::RightToLeft});
  EXPECT_EQ(played(path("city.png")), std::vector<WovenFrame>{expected});
  EXPECT_EQ(woven_by_command({path("city.png")}), expected);
  write("city.json", "{");
  expect_end(run({"play", path("city.png"), "--rig", kTiny}), 4, "city.json");
  save("town_qs3x2a1.5.png", quilt_picture(3, 2, 0));
  write("town_qs3x2a1.5.json", R"({"columns": 2, "rows": 3})");
  expect_end(run({"play", path("town_qs3x2a1.5.png"), "--rig", kTiny}), 4,
             "its name says 3 x 2 tiles, town_qs3x2a1.5.json 2 x 3");
  succeed(run(
      {"weave", path("town_qs3x2a1.5.png"), "--grid", "3x2", "--rig", kTiny, "-o", path("w.png")}));
}

TEST_F(ContentCommand, FramesForAnotherRigAreRefusedOrRewoven) {
  save("q_qs3x2a1.5.png", quilt_picture(3, 2, 0));
  succeed(convert({path("q_qs3x2a1.5.png"), "--rig", kTiny, "-o", path("tiny.lts")}));
  expect_end(run({"play", path("tiny.lts"), "--rig", kOther}), 4, "'tiny'");
  expect_end(convert({path("tiny.lts"), "--rig", kOther, "-o", path("b.lts")}), 4, "--reweave");
  // The rig has the same panel and other lenses: frames for it would look wrong here without a
  // warning.
  optics::Rig shifted = optics::load_rig(kTiny);
  shifted.sheet.offset = Lenses(shifted.sheet.offset.value + 0.4);
  optics::save_rig(shifted, path("shifted.toml"));
  expect_end(run({"play", path("tiny.lts"), "--rig", path("shifted.toml")}), 4, "--reweave");
  const auto anew = played(path("tiny.lts"), {"--reweave"}, path("shifted.toml"));
  ASSERT_EQ(anew.size(), 1U);
  const WovenFrame straight = woven(quilt_picture(3, 2, 0), kGrid, {}, path("shifted.toml"));
  const WovenFrame as_it_was = woven(quilt_picture(3, 2, 0), kGrid);
  const auto off = [&](const WovenFrame& frame) {
    double sum = 0.0;
    for (size_t n = 0; n < frame.bytes().size(); ++n) {
      const double d = double{frame.bytes()[n] * 1.0} - straight.bytes()[n];
      sum += d * d;
    }
    return std::sqrt(sum / static_cast<double>(frame.bytes().size()));
  };
  EXPECT_LT(off(anew[0]), 0.6 * off(as_it_was));
  succeed(convert(
      {path("tiny.lts"), "--reweave", "--rig", path("shifted.toml"), "-o", path("anew.lts")}));
  EXPECT_EQ(played(path("anew.lts"), {}, path("shifted.toml")), anew);
}

TEST_F(ContentCommand, RefusesImpossibleConversions) {
  save("w0.png", quilt_picture(1, 1, 0, 48, 32));
  save("q_qs3x2a1.5.png", quilt_picture(3, 2, 0));
  expect_end(convert({path("w%d.png"), "--as", "quilt", "-o", path("q.png")}), 2, "--from-rig");
  expect_end(
      convert({path("q_qs3x2a1.5.png"), "--as", "quilt", "--rig", kTiny, "-o", path("q.png")}), 2,
      "quilts and views");
  expect_end(convert({path("q_qs3x2a1.5.png"), "--resume", "-o", path("q.mkv")}), 2, "--resume");
  expect_end(convert({path("q_qs3x2a1.5.png"), "-o", path("no_qs2x2.png")}), 2, "name");
  expect_end(convert({path("w%d.png"), "--frames", "0:9", "-o", path("o%d.png")}), 4, "0:1");
  expect_end(
      run({"play", path("q_qs3x2a1.5.png"), "--rig", kTiny, "--grid", "3x2", "--stereo", "sbs"}), 2,
      "exclude");
  expect_end(run({"play", "card", "--rig", kTiny, "--stereo", "sbs"}), 2, "a single file");
  expect_end(run({"play", path("w0.png"), "--rig", kTiny, "--depth", path("no.png")}), 4, "no.png");
  expect_end(
      run({"play", path("w0.png"), "--rig", kTiny, "--depth", "right", "--depth-range", "1"}), 2,
      "--depth-range");
  expect_end(run({"play", path("w0.png"), "--rig", kTiny, "--invert"}), 2, "woven frames");
  expect_end(run({"play", path("q_qs3x2a1.5.png"), "--rig", kTiny, "--invert-depth"}), 2,
             "no depth");
  expect_end(run({"play", "views:" + path("none%d.png"), "--rig", kTiny}), 4, "none%d.png");
}

TEST_F(ContentCommand, ResumesAnInterruptedContainer) {
  for (int n = 0; n < 6; ++n) save(fmt::format("p_qs3x2a1.5_{}.png", n), quilt_picture(3, 2, n));
  const std::string input = path("p_qs3x2a1.5_%d.png");
  succeed(convert({input, "-o", path("whole.lts")}));
  succeed(convert({input, "-o", path("part.lts"), "--frames", "0:3"}));
  const ProcessResult rest = convert({input, "-o", path("part.lts"), "--resume", "--json"});
  succeed(rest);
  EXPECT_EQ(nlohmann::json::parse(rest.out)["frames_skipped"], 3);
  EXPECT_EQ(nlohmann::json::parse(rest.out)["frames_converted"], 3);
  EXPECT_EQ(read_text(path("part.lts")), read_text(path("whole.lts")));
}

TEST_F(ContentCommand, AListDetectsEachItemsFormatByItsName) {
  save("q_qs3x2a1.5.png", quilt_picture(3, 2, 0));
  save("eyes_sbs.png", two_eyes(true));
  write("list.toml",
        "format = 1\n[[item]]\nsource = \"q_qs3x2a1.5.png\"\nloops = 1\n"
        "[[item]]\nsource = \"eyes_sbs.png\"\nloops = 1\n");
  const auto shown = played(path("list.toml"));
  ASSERT_EQ(shown.size(), 2U);
  EXPECT_EQ(shown[0], woven(quilt_picture(3, 2, 0), kGrid));
  expect_end(run({"play", path("list.toml"), "--rig", kTiny, "--stereo", "sbs"}), 2,
             "need a single file");
}

}  // namespace
}  // namespace lenticule::test
