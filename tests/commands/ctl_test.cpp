// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule ctl` with players on the virtual display.
#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <thread>

#include "tests/commands/player_stage.h"

namespace lenticule::test {
namespace {

constexpr int kFrames = 20;

/// Returns the value of every pixel of frame k of film `film`.
uint8_t level(int film, uint64_t k) {
  return static_cast<uint8_t>(100 * film + static_cast<int>(k));
}

class Ctl : public PlayerTest {
 protected:
  /// Written once for all tests: writing pictures safely takes longer than most tests.
  static void SetUpTestSuite() {
    films_.emplace();
    for (int film = 0; film < 2; ++film) {
      std::filesystem::create_directories(films_->path() / film_name(film));
      for (uint64_t k = 0; k < kFrames; ++k) write_frame(film, k, films_->path() / film_name(film));
    }
  }
  static void TearDownTestSuite() { films_.reset(); }

  static void write_frame(int film, uint64_t k, const std::filesystem::path& folder) {
    frames::WovenFrame frame(kPanel);
    std::fill(frame.bytes().begin(), frame.bytes().end(), level(film, k));
    frames::write_woven(frame.view(), frames::FilePattern((folder / "%03d.png").string()).path(k));
  }

  void SetUp() override {
    PlayerTest::SetUp();
    socket_ = path("c.sock");
    for (const char* film : {"a", "b"})
      std::filesystem::create_directory_symlink(films_->path() / film, path(film));
    write("list.toml",
          "loop = \"forever\"\n[[item]]\nsource = \"a/%03d.png\"\n"
          "loops = \"forever\"\n[[item]]\nsource = \"b/%03d.png\"\n"
          "loops = \"forever\"\n");
  }
  static std::string film_name(int film) { return film == 0 ? "a" : "b"; }
  [[nodiscard]] std::string film_pattern(int film) const {
    return path(film_name(film) + "/%03d.png");
  }
  void start(const std::string& source, std::vector<std::string> more = {}) {
    more.insert(more.end(),
                {"--record", "checksums:" + path("sums"), "--stats", path("stats.json")});
    PlayerTest::start(play_words(source, more));
    ASSERT_TRUE(comes_true([this] {
      return std::filesystem::exists(path("c.sock")) && displayed().contains("frame");
    }));
  }
  /// Returns the answer to a verb and expects success.
  [[nodiscard]] json answer(const std::vector<std::string>& words) const {
    const ProcessResult result = ctl(words);
    EXPECT_EQ(result.exit_code, 0) << words.front() << ": " << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json::object();
  }
  [[nodiscard]] json displayed() const {
    const ProcessResult result = ctl({"status"});
    if (result.exit_code != 0) return json::object();
    const json place = json::parse(result.out).value("displayed", json());
    return place.is_object() ? place : json::object();
  }
  [[nodiscard]] bool shows(int film, uint64_t frame) const {
    const json place = displayed();
    return place.value("frame", uint64_t{9999}) == frame &&
           place.value("source", "") == film_pattern(film);
  }
  void pause_still() const {
    EXPECT_EQ(answer({"pause"})["paused"], true);
    std::this_thread::sleep_for(
        std::chrono::milliseconds(50));  // time for a pending flip to complete
  }
  [[nodiscard]] std::vector<std::string> recorded() const {
    std::vector<std::string> lines;
    std::ifstream file(path("sums"));
    for (std::string line; std::getline(file, line);)
      if (!line.empty() && line.front() != '#') lines.push_back(line);
    return lines;
  }

  inline static std::optional<ScratchFolder> films_;
};

TEST_F(Ctl, APauseStopsDisplayedFrames) {
  start(film_pattern(0), {"--loop", "forever"});
  pause_still();
  EXPECT_EQ(answer({"status"})["state"], "paused");
  EXPECT_EQ(answer({"status"})["reason"], "until 'play'");
  const uint64_t shown = frames_shown();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(frames_shown(), shown);
  EXPECT_EQ(quit().exit_code, 143);
  const std::vector<std::string> lines = recorded();
  EXPECT_EQ(lines.size(), shown) << "the recorder saw as many, and none while it was paused";
  EXPECT_FALSE(std::filesystem::exists(path("c.sock")));
  const json stats = json::parse(std::ifstream(path("stats.json")));
  EXPECT_GE(stats["held"].get<uint64_t>(), 10u);
  EXPECT_EQ(stats["repeated_underrun"], 0) << "a pause is no underrun";
}

TEST_F(Ctl, SeekAndNextLandOnTheExactFrame) {
  start(path("list.toml"));
  pause_still();
  ASSERT_EQ(answer({"seek", "--frame", "17"})["frame"], 17);
  ASSERT_TRUE(comes_true([&] { return shows(0, 17); }));
  EXPECT_EQ(displayed_level(), level(0, 17));
  EXPECT_EQ(answer({"next"})["item"], 1);
  ASSERT_TRUE(comes_true([&] { return shows(1, 0); }));
  EXPECT_EQ(displayed_level(), level(1, 0));
  EXPECT_EQ(answer({"seek", "--item", "0", "--frame", "19"})["item"], 0);
  ASSERT_TRUE(comes_true([&] { return shows(0, 19); }));
  EXPECT_EQ(displayed_level(), level(0, 19));
  EXPECT_EQ(ctl({"seek", "--frame", "20"}).exit_code, 2);
  EXPECT_EQ(ctl({"seek", "--item", "2"}).exit_code, 2);
  EXPECT_TRUE(shows(0, 19));
  EXPECT_EQ(answer({"play"})["paused"], false);
  EXPECT_TRUE(comes_true([&] { return !shows(0, 19); })) << "and it goes on from there";
}

TEST_F(Ctl, AFailedLoadLeavesTheOldSourcePlaying) {
  start(film_pattern(0), {"--loop", "forever"});
  write("broken.png", "no picture");
  write("broken.toml", "loop = never\n");
  for (const char* bad : {"broken.png", "missing.png", "broken.toml", "missing.toml"}) {
    expect_end(ctl({"load", path(bad)}), 1, bad);
  }
  const uint64_t before = frames_shown();
  EXPECT_TRUE(comes_true([&] { return frames_shown() > before; }));
  EXPECT_EQ(displayed()["source"], film_pattern(0));
  EXPECT_EQ(answer({"load", film_pattern(1), "--frame", "5"})["source"], film_pattern(1));
  EXPECT_TRUE(comes_true([&] { return displayed()["source"] == film_pattern(1); }));
}

TEST_F(Ctl, ATrimChangesFramesWovenByThePlayer) {
  start("views", {"--loop", "forever"});
  (void)answer({"snapshot", path("before.png")});
  EXPECT_EQ(answer({"trim", "--offset-by", "0.25"})["offset_lenses"], 0.25);
  const frames::WovenFrame before = frames::read_woven(path("before.png"));
  ASSERT_TRUE(comes_true([&] {
    (void)answer({"snapshot", path("after.png")});
    return frames::read_woven(path("after.png")) != before;
  }));
  EXPECT_EQ(answer({"trim", "--offset", "0"})["offset_lenses"], 0.0);
  EXPECT_TRUE(comes_true([&] {
    (void)answer({"snapshot", path("again.png")});
    return frames::read_woven(path("again.png")) == before;
  }));
  EXPECT_EQ(ctl({"trim", "--offset", "7"}).exit_code, 1) << "more than a lens is no drift";
  const json eye = answer({"snapshot", path("eye.png"), "--eye", "10,0,500"});
  EXPECT_EQ(eye["width"], frames::read_woven(path("eye.png")).width());
}

TEST_F(Ctl, AdviceAboutATrimFollowsTheContentThatIsPlayed) {
  start("views", {"--loop", "forever"});
  EXPECT_FALSE(answer({"trim", "--offset-by", "0.01"}).contains("advice"));
  (void)answer({"load", film_pattern(0)});
  EXPECT_TRUE(answer({"trim", "--offset-by", "0.01"}).contains("advice"));
  (void)answer({"load", "views"});
  EXPECT_FALSE(answer({"trim", "--offset-by", "0.01"}).contains("advice"));
}

TEST_F(Ctl, APictureStaysUntilItIsEnded) {
  start(film_pattern(0).replace(film_pattern(0).find("%03d"), 4, "004"));
  const uint64_t shown = frames_shown();
  EXPECT_TRUE(comes_true([&] { return frames_shown() >= shown + 8; })) << "four times a second";
  EXPECT_EQ(quit().exit_code, 143);
  const auto vblanks = [&](const std::vector<std::string>& more) {
    return results_of(run(joined({"play", path("a/004.png"), "--rig", path("rig.toml"), "--display",
                                  "virtual:48x32@60", "--json"},
                                 more)))
        .value("vblanks", 0);
  };
  EXPECT_EQ(vblanks({"--clock", "simulated"}), 600) << "ten seconds";
  EXPECT_EQ(vblanks({"--clock", "simulated", "--loop", "2"}), 1200);
  EXPECT_EQ(vblanks({"--duration", "0.5"}), 30);
}

TEST_F(Ctl, AListWithoutAPlayableItemShowsItsDefaultAndSaysWhy) {
  write("gone.toml",
        "loop = \"forever\"\n[default]\nsource = \"card\"\n[[item]]\nsource = \"x.png\"\n"
        "[[item]]\nsource = \"y.png\"\n");
  start(path("gone.toml"));
  EXPECT_EQ(displayed()["source"], "card");
  const std::string why = "none of 2 items can be played: ";
  EXPECT_EQ(answer({"status"})["state"], "failed");
  EXPECT_TRUE(answer({"status"})["reason"].get<std::string>().starts_with(why));
  EXPECT_NE(quit().err.find(path("gone.toml") + ": " + why), std::string::npos);
}

TEST_F(Ctl, AListOfOneItemIsTriedAgain) {
  write("one.toml", "loop = \"forever\"\n[[item]]\nsource = \"late.png\"\n");
  start(path("one.toml"));
  EXPECT_EQ(displayed()["source"], "black");
  EXPECT_EQ(answer({"status"})["state"], "failed");
  EXPECT_NE(answer({"status"})["reason"].get<std::string>().find("late.png"), std::string::npos);
  std::filesystem::copy(film_pattern(0).replace(film_pattern(0).find("%03d"), 4, "004"),
                        path("late.png"));
  EXPECT_TRUE(comes_true([&] { return displayed()["source"] == path("late.png"); }));
}

TEST_F(Ctl, SubscribePrintsOneLinePerEventAndEndsAtItsCount) {
  start(path("list.toml"));
  BackgroundProcess listener(
      program({"ctl", "--socket", path("c.sock"), "subscribe", "--count", "2"}));
  // The load's events can only arrive if the listener has subscribed by then.
  (void)answer({"load", film_pattern(1)});
  const ProcessResult heard = listener.wait(std::chrono::seconds(60));
  EXPECT_EQ(heard.exit_code, 0) << heard.err;
  std::istringstream lines(heard.out);
  int events = 0;
  for (std::string line; std::getline(lines, line); ++events)
    EXPECT_TRUE(json::parse(line).contains("event")) << line;
  EXPECT_EQ(events, 2);
  EXPECT_EQ(answer({"loop", "1"})["count"], 1);
  EXPECT_EQ(player_->wait(std::chrono::seconds(60)).exit_code, 0);
}

TEST_F(Ctl, ExitCodesFollowTheContract) {
  EXPECT_EQ(ctl({"status"}).exit_code, 3) << "no player";
  EXPECT_EQ(
      run_process({"/usr/bin/env", "-u", "LENTICULE_CONTROL", LENTICULE_PROGRAM, "ctl", "status"})
          .exit_code,
      3)
      << "no service";
  EXPECT_EQ(ctl({"explode"}).exit_code, 2);
  EXPECT_EQ(ctl({"load"}).exit_code, 2);
  start(film_pattern(0), {"--loop", "forever"});
  EXPECT_EQ(ctl({"seek"}).exit_code, 2);
  expect_end(ctl({"seek", "10"}), 2, "write --frame 10");
  expect_end(ctl({"play", "film.lts"}), 2, "lenticule ctl load film.lts");
  EXPECT_EQ(ctl({"snapshot", path("s.gif")}).exit_code, 2);
  EXPECT_EQ(ctl({"snapshot", path("nowhere/s.png")}).exit_code, 1);
  EXPECT_EQ(run({"play", film_pattern(0), "--rig", path("rig.toml"), "--control", path("c.sock")})
                .exit_code,
            3)
      << "another player listens there";
  EXPECT_EQ(answer({"doctor"})["exactness"], nullptr);
  EXPECT_TRUE(answer({"stats"})["statistics"].contains("shown"));
}

TEST_F(Ctl, AListPlaysItsItemsAndNamesSkippedOnes) {
  write("short.toml",
        "[[item]]\nsource = \"a/%03d.png\"\n[[item]]\nsource = \"gone.png\"\n"
        "[[item]]\nsource = \"b/%03d.png\"\nfps = \"30\"\nframes = \"0:10\"\n");
  const ProcessResult played =
      run({"play", path("short.toml"), "--rig", path("rig.toml"), "--display", "virtual:48x32@60",
           "--clock", "simulated", "--record", "checksums:" + path("sums"), "--json"});
  expect_end(played, 0, "left out: " + path("gone.png"));
  const json stats = json::parse(played.out);
  EXPECT_EQ(stats["shown"], kFrames + 10);
  EXPECT_EQ(stats["vblanks"], kFrames + 20);
  EXPECT_EQ(stats["repeated_underrun"], 0);
  EXPECT_EQ(stats["playlist"]["items_skipped"], 1);
  write("wrong.toml", "[[item]]\nsource = \"a.png\"\nspeed = 2\n");
  expect_end(run({"play", path("wrong.toml"), "--rig", path("rig.toml")}), 4,
             "wrong.toml:3: unknown key 'speed'");
}

/// Changes the byte in the middle of a file.
void damage(const std::string& file_name) {
  std::fstream file(file_name, std::ios::in | std::ios::out | std::ios::binary);
  const auto middle = static_cast<std::streamoff>(std::filesystem::file_size(file_name) / 2);
  file.seekg(middle);
  const int byte = file.get();
  file.seekp(middle);
  file.put(static_cast<char>(byte ^ 1));
}

TEST_F(Ctl, AFilmWithoutAGoodFrameIsReportedAsLeftOutOnly) {
  const std::string film = path("film.lts");
  ASSERT_EQ(
      run({"convert", film_pattern(0), "--rig", path("rig.toml"), "--frames", "0:1", "-o", film})
          .exit_code,
      0);
  damage(film);
  write("list.toml", "[[item]]\nsource = \"film.lts\"\n[[item]]\nsource = \"b/%03d.png\"\n");
  const ProcessResult played =
      run({"play", path("list.toml"), "--rig", path("rig.toml"), "--display", "virtual:48x32@60",
           "--clock", "simulated", "--json"});
  expect_end(played, 0, "left out: " + film);
  EXPECT_EQ(played.err.find("damaged: " + film), std::string::npos) << played.err;
  EXPECT_EQ(json::parse(played.out)["damaged_frames"], 0);
}

TEST_F(Ctl, ADamagedItemIsReportedOnceHoweverOftenItPlays) {
  const std::string film = path("film.lts");
  ASSERT_EQ(run({"convert", film_pattern(0), "--rig", path("rig.toml"), "-o", film}).exit_code, 0);
  damage(film);
  // The second item has three times the damage of the first.
  write("list.toml",
        "[[item]]\nsource = \"film.lts\"\n[[item]]\nsource = \"film.lts\"\nloops = 3\n");
  const ProcessResult played =
      run({"play", path("list.toml"), "--rig", path("rig.toml"), "--display", "virtual:48x32@60",
           "--clock", "simulated", "--slots", "3", "--json"});
  ASSERT_EQ(played.exit_code, 0) << played.err;
  const std::string report = "damaged: " + film;
  const size_t first = played.err.find(report);
  ASSERT_NE(first, std::string::npos) << played.err;
  EXPECT_EQ(played.err.find(report, first + 1), std::string::npos) << played.err;
  EXPECT_GE(json::parse(played.out)["damaged_frames"], 4);
}

TEST_F(Ctl, PreflightReportsIfTheSourceIsFastEnough) {
  std::filesystem::create_directory(path("own"));
  for (uint64_t k = 0; k < 5; ++k) write_frame(0, k, path("own"));
  const auto preflight = [&](const std::string& fps) {
    return run({"play", path("own/%03d.png"), "--rig", path("rig.toml"), "--preflight", "--fps",
                fps, "--slots", "2", "--json"});
  };
  EXPECT_EQ(results_of(preflight("0.01"))[0]["figures"]["too_slow"], false);
  write("fade.toml", "transition = \"fade\"\n[[item]]\nsource = \"own/%03d.png\"\n");
  const json rows = results_of(run({"play", path("fade.toml"), "--rig", path("rig.toml"),
                                    "--preflight", "--fps", "0.01", "--json"}));
  EXPECT_EQ(rows[0]["transition"]["too_slow"], false);
  EXPECT_GT(rows[0]["transition"]["seen_frames_per_s"], 0.01);
  write("own/004.png", "no picture");
  EXPECT_EQ(preflight("0.01").exit_code, 4);
}

}  // namespace
}  // namespace lenticule::test
