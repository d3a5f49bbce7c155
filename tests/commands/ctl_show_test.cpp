// SPDX-License-Identifier: Apache-2.0
// Tests the verbs of `lenticule ctl` with which a show is run: interruptions, cues, black, speed
// and power, with a player on the virtual display.
#include "tests/commands/player_stage.h"
#include "tests/commands/sequence_films.h"

namespace lenticule::test {
namespace {

class CtlShow : public PlayerTest {
 protected:
  void SetUp() override {
    PlayerTest::SetUp();
    write_sequence(path("film.lts"), path("rig.toml"), 10);
    write_sequence(path("alarm.lts"), path("rig.toml"), 100);
    write("list.toml",
          "loop = \"forever\"\n[[item]]\nsource = \"film.lts\"\nloops = 1000\n"
          "[[item]]\nsource = \"alarm.lts\"\n");
    start(play_words(path("list.toml"), {"--slots", "12"}));
    ASSERT_TRUE(comes_true([this] { return frames_shown() > 3; }));
  }
  [[nodiscard]] bool shows(const std::string& film) const {
    return says_about("displayed", path(film + ".lts"));
  }
};

TEST_F(CtlShow, AnInterruptionIsPlayedOnceAndThenTheListContinues) {
  ASSERT_EQ(asked({"interrupt", path("alarm.lts")})["source"], path("alarm.lts"));
  EXPECT_TRUE(comes_true([this] { return shows("film") && status()["interrupted"].is_null(); }));
  EXPECT_EQ(status()["displayed"]["item"], 0);
  ASSERT_TRUE(asked({"interrupt", "--item", "1", "--seconds", "3600"}).is_object());
  EXPECT_TRUE(comes_true([this] { return shows("alarm"); }));
  EXPECT_EQ(status()["interrupted"], path("film.lts"));
  ASSERT_TRUE(asked({"back"}).is_object());
  EXPECT_TRUE(comes_true([this] { return shows("film"); }));
  expect_end(ctl({"back"}), 1, "nothing is interrupted");
}

TEST_F(CtlShow, AnOverlayIsShownReplacedAndRemovedAlsoWhilePaused) {
  write_picture("logo.png", 222, {.width = 9, .height = 5});
  ASSERT_TRUE(asked({"pause"}).is_object());
  ASSERT_TRUE(asked({"seek", "--frame", "1"}).is_object());
  ASSERT_TRUE(comes_true([this] { return displayed_level() == 11; }));
  EXPECT_EQ(status()["overlays"], json::array());
  const std::string logo = "picture " + path("logo.png") + ", top left";
  EXPECT_EQ(asked({"overlay", "--picture", path("logo.png"), "--at", "top left"})["overlay"], logo);
  ASSERT_TRUE(comes_true([this] { return displayed_level() == -1; }));
  const frames::WovenFrame snap = frames::read_woven(path("snap.png"));
  int overlaid = 0;
  for (const uint8_t byte : snap.bytes()) {
    EXPECT_TRUE(byte == 222 || byte == 11);
    overlaid += byte == 222 ? 1 : 0;
  }
  EXPECT_EQ(overlaid, 9 * 5 * 3);
  EXPECT_EQ(status()["overlays"], json::array({logo}));
  EXPECT_EQ(asked({"overlay", "--text", "x", "--at", "middle"})["overlay"], "text x, middle");
  EXPECT_TRUE(comes_true([this] { return says_about("overlays", "text x"); }));
  EXPECT_EQ(asked({"overlay", "--off"})["overlay"], nullptr);
  EXPECT_TRUE(comes_true([this] { return displayed_level() == 11; }));
  ASSERT_TRUE(asked({"overlay", "--text", "x", "--for", "5"}).is_object());
  EXPECT_TRUE(comes_true([this] { return says_about("overlays", "text x"); }));
  EXPECT_TRUE(comes_true([this] { return displayed_level() == 11; }));
  EXPECT_EQ(status()["overlays"], json::array());
  ASSERT_TRUE(asked({"play"}).is_object());
  ASSERT_TRUE(asked({"overlay", "--clock", "%H:%M", "--for", "0.2"}).is_object());
  EXPECT_TRUE(comes_true([this] { return status()["overlays"] == json::array(); }));
  EXPECT_TRUE(comes_true(
      [this] { return asked({"stats"})["statistics"].value("frames_with_overlays", 0) > 2; }));
  expect_end(ctl({"overlay", "--picture", path("gone.png")}), 1, "gone.png");
  expect_end(ctl({"overlay", "--text", "\xc3\xbc"}), 2, "the font has no letter");
  expect_end(ctl({"overlay"}), 2, "nothing to show");
}

TEST_F(CtlShow, AFrameOfARangeIsShownAgainWithAnOverlay) {
  write("part.toml", "loop = \"forever\"\n[[item]]\nsource = \"alarm.lts\"\nframes = \"2:5\"\n");
  ASSERT_TRUE(asked({"load", path("part.toml")}).is_object());
  ASSERT_TRUE(asked({"pause"}).is_object());
  ASSERT_TRUE(asked({"seek", "--frame", "1"}).is_object());
  ASSERT_TRUE(comes_true([this] { return displayed_level() == 103; }));
  EXPECT_EQ(status()["displayed"]["frame"], 1);
  ASSERT_TRUE(asked({"overlay", "--text", "x", "--at", "middle"}).is_object());
  ASSERT_TRUE(comes_true([this] { return displayed_level() == -1; }));
  ASSERT_TRUE(asked({"overlay", "--off"}).is_object());
  EXPECT_TRUE(comes_true([this] { return displayed_level() == 103; }));
}

TEST_F(CtlShow, AnOverlayThatCannotBeDrawnIsReportedOnceAndTheFilmPlays) {
  write("overlaid.toml",
        "loop = 2\n[[overlay]]\npicture = \"gone.png\"\n[[overlay]]\ntext = \"x\"\n"
        "[[item]]\nsource = \"film.lts\"\n[[item]]\nsource = \"alarm.lts\"\n");
  const std::vector<std::string> words = {
      "play",      path("overlaid.toml"), "--rig", path("rig.toml"),
      "--display", "virtual:48x32@60",    "--json"};
  const ProcessResult played = run(joined(words, {"--clock", "simulated"}));
  expect_end(played, 0, "left out: " + path("gone.png"));
  EXPECT_EQ(played.err.find("left out", played.err.find("left out") + 8), std::string::npos);
  const json stats = json::parse(played.out);
  EXPECT_GT(stats["shown"], 0);
  EXPECT_EQ(stats["frames_with_overlays"], stats["shown"]);
  EXPECT_EQ(run(joined(words, {"--preflight"})).exit_code, 4);
}

TEST_F(CtlShow, ABlankPanelIsBlackUntilBack) {
  ASSERT_TRUE(asked({"blank"}).is_object());
  EXPECT_TRUE(comes_true([this] { return says_about("displayed", "black"); }));
  ASSERT_TRUE(asked({"back"}).is_object());
  EXPECT_TRUE(comes_true([this] { return shows("film"); }));
}

TEST_F(CtlShow, APictureThatInterruptsEndsAfterItsSeconds) {
  write_film("poster", 9);
  ASSERT_TRUE(asked({"interrupt", path("poster/000.png"), "--seconds", "1"}).is_object());
  EXPECT_TRUE(comes_true([this] { return shows("film") && status()["interrupted"].is_null(); }));
}

TEST_F(CtlShow, BackEndsABlankPanelAlsoIfWhatWasPlayedIsGone) {
  std::filesystem::create_directory(path("stick"));
  std::filesystem::copy(path("film.lts"), path("stick/old.lts"));
  // A file is played when it has not grown for two seconds.
  ASSERT_TRUE(comes_true([this] { return asked({"load", path("stick/")}).is_object(); }));
  ASSERT_TRUE(comes_true([this] { return shows("stick/old"); }));
  ASSERT_TRUE(asked({"blank"}).is_object());
  ASSERT_TRUE(comes_true([this] { return says_about("displayed", "black"); }));
  std::filesystem::remove(path("stick/old.lts"));
  std::filesystem::copy(path("alarm.lts"), path("stick/new.lts"));
  ASSERT_TRUE(asked({"back"}).is_object());
  EXPECT_TRUE(comes_true([this] { return shows("stick/new"); })) << status().dump();
}

TEST_F(CtlShow, ACuedItemIsShownByGoAndAGoWithoutCueNamesTheRemedy) {
  expect_end(ctl({"go"}), 1, "no item is cued", "cue SOURCE");
  EXPECT_EQ(ctl({"cue"}).exit_code, 2);
  EXPECT_EQ(ctl({"cue", path("missing.lts")}).exit_code, 1);
  ASSERT_EQ(asked({"cue", path("alarm.lts"), "--then-back"})["cued"], path("alarm.lts"));
  EXPECT_EQ(status()["cued"], path("alarm.lts"));
  EXPECT_TRUE(shows("film"));
  ASSERT_EQ(asked({"go"})["source"], path("alarm.lts"));
  EXPECT_EQ(status()["cued"], nullptr);
  EXPECT_TRUE(comes_true([this] { return shows("film") && status()["interrupted"].is_null(); }));
}

TEST_F(CtlShow, TheSpeedIsChangedWithinItsLimits) {
  EXPECT_EQ(asked({"speed", "0.5"})["factor"], 0.5);
  EXPECT_EQ(status()["speed"], 0.5);
  EXPECT_TRUE(comes_true([this] {
    return asked({"stats"})["statistics"].value("content_rate", "") == "30";
  })) << asked({"stats"}).dump();
  EXPECT_EQ(ctl({"speed", "9"}).exit_code, 2);
  EXPECT_EQ(ctl({"speed", "0"}).exit_code, 2);
}

TEST_F(CtlShow, TheVolumeIsChangedWithinItsLimits) {
  EXPECT_EQ(asked({"volume", "-12.5"})["db"], -12.5);
  EXPECT_EQ(status()["sound"]["volume_db"], -12.5);
  EXPECT_EQ(ctl({"volume", "20"}).exit_code, 2);
  EXPECT_EQ(ctl({"volume"}).exit_code, 2);
}

TEST_F(CtlShow, AnOutputThatIsOffHoldsTheContentUntilItIsOn) {
  EXPECT_EQ(asked({"power", "off"}), json({{"power", "off"}, {"done", true}}));
  EXPECT_EQ(status()["state"], "off");
  const uint64_t shown = frames_shown();
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(frames_shown(), shown);
  EXPECT_EQ(asked({"power", "on"})["done"], true);
  EXPECT_EQ(status()["state"], "playing");
  EXPECT_TRUE(film_continues());
  EXPECT_EQ(ctl({"power", "dim"}).exit_code, 2);
}

}  // namespace
}  // namespace lenticule::test
