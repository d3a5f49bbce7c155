// SPDX-License-Identifier: Apache-2.0
// Tests video files on the command line: played by lenticule, probed and written by
// lenticule-video.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "frames/frame.h"
#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/comes_true.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;

constexpr int kWidth = 48;  // size of scenes/rigs/tiny.toml
constexpr int kHeight = 32;
constexpr int kHertz = 48'000;

class VideoCommands : public CommandTest {
 protected:
  [[nodiscard]] static ProcessResult video(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), LENTICULE_VIDEO_PROGRAM);
    return run_process(arguments);
  }

  void make_clip(const std::string& name, int width, int height, int frames) const {
    std::string raw(static_cast<size_t>(width * height * 3 * frames), '\0');
    for (size_t i = 0; i < raw.size(); ++i) raw[i] = static_cast<char>(i * i >> 3);
    write("raw", raw);
    expect_end(
        run_process({"/bin/sh", "-c",
                     std::string("exec ") + LENTICULE_VIDEO_PROGRAM + " encode --rate 30 --width " +
                         std::to_string(width) + " --height " + std::to_string(height) + " " +
                         " > " + path(name) + " < " + path("raw")}),
        0);
  }
  /// Makes a film of thirty frames a second with the program ffmpeg.
  void make_film(const std::string& name, int width, int height, const std::string& words) const {
    expect_end(run_process({"/bin/sh", "-c",
                            fmt::format("exec ffmpeg -v error -nostdin -y -f lavfi -i "
                                        "testsrc2=size={}x{}:rate=30:duration=2 {} {}",
                                        width, height, words, path(name))}),
               0);
  }

  [[nodiscard]] std::vector<std::string> play(const std::string& name) const {
    return {"play",      path(name), "--rig", source_file("scenes/rigs/tiny.toml"),
            "--display", "virtual"};
  }

  /// Returns the samples of a WAV file, both channels in turn.
  [[nodiscard]] static std::vector<int16_t> codes_of(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    const std::string wav((std::istreambuf_iterator<char>(in)), {});
    std::vector<int16_t> codes(wav.size() < 44 ? 0 : (wav.size() - 44) / 2);
    if (!codes.empty()) std::memcpy(codes.data(), wav.data() + 44, codes.size() * 2);
    return codes;
  }

  /// Returns the decoder that any thread of `player` has started; 0 if there is none.
  [[nodiscard]] static pid_t decoder_of(pid_t player) {
    std::error_code gone;
    const fs::path threads = "/proc/" + std::to_string(player) + "/task";
    for (const auto& thread : fs::directory_iterator(threads, gone)) {
      std::ifstream in(thread.path() / "children");
      pid_t child = 0;
      std::string name;
      in >> child;
      std::ifstream("/proc/" + std::to_string(child) + "/cmdline") >> name;
      if (name.find("decode") != std::string::npos) return child;
    }
    return 0;
  }

  /// Returns true if the process exists and is not a zombie.
  [[nodiscard]] static bool runs(pid_t process) {
    const std::string text = read_text("/proc/" + std::to_string(process) + "/stat");
    const size_t state = text.rfind(')') + 2;
    return state < text.size() && text[state] != 'Z' && text[state] != 'X';
  }
};

TEST_F(VideoCommands, PlayShowsEveryFrameInEveryLoop) {
  make_clip("clip.mkv", kWidth, kHeight, 10);
  std::vector<std::string> words = play("clip.mkv");
  words.insert(words.end(), {"--clock", "simulated", "--loop", "3", "--json"});
  const json statistics = results_of(run(words));
  EXPECT_EQ(statistics["shown"], 30);
  EXPECT_EQ(statistics["loops"], 3);
  EXPECT_EQ(statistics["content_rate"], "30");
}

TEST_F(VideoCommands, PlayRefusesOtherSizesAndSubsampledChroma) {
  make_clip("large.mkv", kWidth + 2, kHeight, 1);
  EXPECT_EQ(run(play("large.mkv")).exit_code, 4);
  make_film("halved.mkv", kWidth, kHeight, "-c:v ffv1 -pix_fmt yuv420p");
  const ProcessResult halved = run(play("halved.mkv"));
  EXPECT_EQ(halved.exit_code, 4);
  EXPECT_THAT(halved.err, testing::HasSubstr("use --grid 1x1"));
}

TEST_F(VideoCommands, ProbeDescribesAClip) {
  make_film("clip.mkv", 20, 10, "-vf format=yuv444p,setparams=colorspace=bt709:range=tv -c:v ffv1");
  const json stream = results_of(video({"probe", path("clip.mkv")}))["streams"][0];
  EXPECT_EQ(stream["width"], 20);
  EXPECT_EQ(stream["rate"], json::parse("[30, 1]"));
  EXPECT_EQ(stream["sampling"], "4:4:4");
  EXPECT_EQ(stream["colour_space"], "bt709");
  EXPECT_EQ(stream["range"], "tv");
  EXPECT_EQ(stream["exact"], false);
  EXPECT_EQ(stream["full_chroma"], true);
}

TEST_F(VideoCommands, AGifOfOneFrameIsConvertedToAPicture) {
  make_film("one.gif", kWidth, kHeight, "-frames:v 1");
  expect_end(run({"convert", path("one.gif"), "-o", path("one.png")}), 0);
  EXPECT_EQ(frames::probe_image(path("one.png")).width, kWidth);
  make_film("two.gif", kWidth, kHeight, "-frames:v 2");
  const ProcessResult two = run({"convert", path("two.gif"), "-o", path("two.png")});
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_THAT(two.err, testing::HasSubstr("--frames 0:1"));
  EXPECT_FALSE(std::filesystem::exists(path("two.png")));
  expect_end(run({"convert", path("two.gif"), "-o", path("two.png"), "--frames", "0:1"}), 0);
}

TEST_F(VideoCommands, AGifOfOneFrameStaysAsAPictureDoes) {
  const auto vblanks = [&](const std::string& name) {
    std::vector<std::string> words = play(name);
    words.insert(words.end(), {"--clock", "simulated", "--json"});
    return results_of(run(words))["vblanks"];
  };
  make_film("one.gif", kWidth, kHeight, "-frames:v 1");
  expect_end(run({"convert", path("one.gif"), "-o", path("one.png")}), 0);
  EXPECT_EQ(vblanks("one.gif"), vblanks("one.png"));
  make_film("two.gif", kWidth, kHeight, "-frames:v 2");
  EXPECT_LT(vblanks("two.gif"), 60);
}

/// Two thirds of a second of 30 frames a second, then a frame every eighth period.
TEST_F(VideoCommands, AFilmOfVariableRateKeepsItsLength) {
  make_film("film.mkv", kWidth, kHeight,
            "-vf \"select='lt(n,20)+not(mod(n,8))'\" -fps_mode vfr -c:v libx264rgb -qp 0");
  std::vector<std::string> words = play("film.mkv");
  words.insert(words.end(), {"--clock", "simulated", "--json"});
  const json played = results_of(run(words));
  EXPECT_EQ(played["content_rate"], "30");
  EXPECT_EQ(played["vblanks"], 2 * 57);
  EXPECT_FALSE(played.contains("missing_frames") && played["missing_frames"] != 0);
  const json converted =
      results_of(run({"convert", path("film.mkv"), "-o", path("constant.mkv"), "--json"}));
  EXPECT_EQ(converted["frames_converted"], 57);
  const json stream = results_of(video({"probe", path("constant.mkv")}))["streams"][0];
  EXPECT_EQ(stream["rate"], json::parse("[30, 1]"));
  EXPECT_EQ(stream["expected_frames"], 57);
}

TEST_F(VideoCommands, ExitCodesFollowTheContract) {
  EXPECT_EQ(video({"--help"}).exit_code, 0);
  EXPECT_EQ(video({"probe"}).exit_code, 2);
  EXPECT_EQ(video({"probe", path("absent.mkv")}).exit_code, 4);
  EXPECT_EQ(video({"probe", folder_.string()}).exit_code, 4);
  const auto encode = [&](const std::string& size) {
    const std::string command = std::string("exec ") + LENTICULE_VIDEO_PROGRAM + " encode " + size;
    return run_process({"/bin/sh", "-c", command + " < /dev/null > " + path("x.mkv")}).exit_code;
  };
  EXPECT_EQ(encode("--width 0 --height 4"), 2);
  EXPECT_EQ(encode("--width 4 --height 4"), 4) << "there is no frame";
  EXPECT_EQ(video({"encode", "--width", "4", "--height", "4"}).exit_code, 2) << "not a file";
}

/// Sound of a list: of a film in two rounds, none, of a quieter item, and of a card.
TEST_F(VideoCommands, ClicksOfAListAreHeardAtTheirFlashes) {
  make_film("film.mkv", kWidth, kHeight,
            "-f lavfi -i \"aevalsrc='if(lt(mod(n+36000\\,24000)\\,480)\\,0.8\\,0)':s=48000:d=2\" "
            "-c:v ffv1 -pix_fmt bgr0 -c:a flac");
  expect_end(run_process({"/bin/sh", "-c",
                          fmt::format("exec ffmpeg -v error -nostdin -y -i {} -vn -c:a copy {}",
                                      path("film.mkv"), path("card.flac"))}),
             0);
  write("list.toml",
        "[[item]]\nsource = \"film.mkv\"\nloops = 2\n"
        "[[item]]\nsource = \"film.mkv\"\nloops = 1\nsound = \"none\"\n"
        "[[item]]\nsource = \"film.mkv\"\nloops = 1\nvolume = -6.0206\n"
        "[[item]]\nsource = \"card\"\nduration_s = 1.0\nsound = \"card.flac\"\n");
  std::vector<std::string> words = play("list.toml");
  words.insert(words.end(),
               {"--clock", "simulated", "--json", "--sound-device", "file:" + path("out.wav")});
  const json sound = results_of(run(words))["sound"];
  EXPECT_EQ(sound["underruns"], 0);
  EXPECT_EQ(sound["jumps"], 0);
  const std::vector<int16_t> codes = codes_of(path("out.wav"));
  ASSERT_GT(codes.size(), size_t{9 * kHertz * 2});
  std::map<size_t, int> clicks;  // their thousandths of a second, and their loudest code
  for (size_t k = 0; k < codes.size(); k += 2)
    if (codes[k] > 2000) clicks[k / 2 / (kHertz / 4) * 250] |= codes[k];
  std::vector<size_t> times;
  for (const auto& [time, loudest] : clicks) times.push_back(time);
  EXPECT_EQ(times, (std::vector<size_t>{250, 750, 1250, 1750, 2250, 2750, 3250, 3750,  //
                                        6250, 6750, 7250, 7750, 8250, 8750}));
  const auto loudness = [&](double at) {
    return codes[static_cast<size_t>(at * kHertz + 240) * 2];
  };
  EXPECT_NEAR(loudness(6.25), loudness(0.25) / 2, 20) << "half the voltage";
}

TEST_F(VideoCommands, TheSoundOfAListGoesOnUnderItsItems) {
  expect_end(run_process({"/bin/sh", "-c",
                          fmt::format("exec ffmpeg -v error -nostdin -y -f lavfi -i "
                                      "\"aevalsrc='0.4*t':s=48000:d=1.01\" -sample_fmt s16 {}",
                                      path("bed.flac"))}),
             0);
  write("list.toml",
        "sound = \"bed.flac\"\nsound_volume = -6.0206\n"
        "[[item]]\nsource = \"card\"\nduration_s = 2.0\n"
        "[[item]]\nsource = \"black\"\nduration_s = 2.0\n");
  std::vector<std::string> words = play("list.toml");
  const json rows = results_of(run(joined(words, {"--preflight", "--json"})));
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[2]["sound"]["codec"], "flac");
  words.insert(words.end(), {"--clock", "simulated", "--json"});
  const json sound =
      results_of(run(joined(words, {"--sound-device", "file:" + path("out.wav")})))["sound"];
  EXPECT_EQ(sound["bed"]["source"], path("bed.flac"));
  EXPECT_EQ(sound["bed"]["volume_db"], -6.0206);
  const std::vector<int16_t> codes = codes_of(path("out.wav"));
  ASSERT_GT(codes.size(), size_t{2 * 4 * kHertz - 9000});
  for (size_t k = kHertz; k < 4 * kHertz - 4500; ++k)
    ASSERT_NEAR(codes[2 * k], 32767 * 0.2 * static_cast<double>(k % 48'480) / kHertz, 3.0) << k;
  EXPECT_EQ(results_of(run(joined(words, {"--sound", "none"})))["sound"]["device"], nullptr);
  write("list.toml", "sound = \"gone.flac\"\n[[item]]\nsource = \"card\"\nduration_s = 1.0\n");
  expect_end(run(words), 0, "gone.flac");
  expect_end(run(joined(play("list.toml"), {"--preflight"})), 4, "gone.flac");
}

TEST_F(VideoCommands, SoundThatIsMissingIsNamed) {
  make_clip("clip.mkv", kWidth, kHeight, 3);
  const auto with = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> words = play("clip.mkv");
    words.insert(words.end(), flags.begin(), flags.end());
    return run(words);
  };
  expect_end(with({"--sound", path("none.flac")}), 4, "none.flac: no such file");
  expect_end(with({"--sound-device", "plughw:30,7"}), 3, "sound device 'plughw:30,7'");
  expect_end(with({"--clock", "simulated", "--sound-device", "auto"}), 2, "real time");
  expect_end(with({"--clock", "simulated", "--sound", "none"}), 0);
  const json sound = results_of(with({"--sound-device", "auto", "--json"}))["sound"];
  EXPECT_EQ(sound["state"], "no sound");
}

TEST_F(VideoCommands, TheDecoderEndsWithThePlayer) {
  make_clip("clip.mkv", kWidth, kHeight, 3);
  std::vector<std::string> words = play("clip.mkv");
  words.insert(words.end(), {"--loop", "forever"});
  // The shell writes its process id before it becomes the player.
  std::string command = "echo $$ > " + path("pid") + "; exec";
  for (const std::string& word : program(words)) command += " '" + word + "'";
  const BackgroundProcess player({"/bin/sh", "-c", command});
  pid_t decoder = 0;
  ASSERT_TRUE(comes_true([&] {
    pid_t pid = 0;
    std::ifstream(path("pid")) >> pid;
    if (pid > 0) decoder = decoder_of(pid);
    return decoder != 0;
  }));
  player.signal(SIGKILL);
  EXPECT_TRUE(comes_true([&] { return !runs(decoder); })) << "decoder " << decoder << " lives on";
}

}  // namespace
}  // namespace lenticule::test
