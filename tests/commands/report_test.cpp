// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule report` with players that write to a real journal.
#include <csignal>

#include "tests/commands/player_stage.h"
#include "tests/commands/private_journal.h"
#include "tests/commands/sequence_films.h"

namespace lenticule::test {
namespace {

constexpr int kLongFilm = 100'000;

class Report : public PlayerTest {
 protected:
  std::unique_ptr<PrivateJournal> journal;

  void SetUp() override {
    PlayerTest::SetUp();
    journal = std::make_unique<PrivateJournal>(path("journal"));
    ASSERT_TRUE(comes_true([this] { return journal->is_ready(); }));
    write_sequence(path("a.lts"), path("rig.toml"), 10, 30);
    write_sequence(path("b.lts"), path("rig.toml"), 50, 12);
  }
  void TearDown() override {
    player_.reset();
    journal.reset();
  }
  void write_list(const std::string& more = {}) const {
    write("day.toml",
          "format = 1\n[[item]]\nsource = \"a.lts\"\n[[item]]\nsource = \"b.lts\"\nloops = 2\n" +
              more);
  }
  void play(const std::string& source, const std::vector<std::string>& more) {
    start(journal->inside(play_words(source, more)));
  }
  /// Plays to the end.
  void play_once(const std::vector<std::string>& more) {
    play(path("day.toml"), more);
    expect_end(player_->wait(kPlayerTimeout), 0);
  }
  [[nodiscard]] ProcessResult report(std::vector<std::string> words = {}) const {
    words.insert(words.begin(), {"report", "--directory", journal->folder()});
    return run(words);
  }
  [[nodiscard]] json reported(std::vector<std::string> words = {}) const {
    words.emplace_back("--json");
    const ProcessResult result = report(words);
    return result.exit_code == 0 ? json::parse(result.out) : json();
  }
  /// Returns the row of an item that players wrote; an empty object if there is none.
  [[nodiscard]] json row(const std::string& item) const {
    for (const json& one : reported().value("rows", json::array()))
      if (one["item"] == path(item) &&
          one["unit"].get<std::string>().find("/lenticule") != std::string::npos)
        return one;
    return json::object();
  }
  [[nodiscard]] bool row_has(const std::string& item, const char* key, int value) const {
    return comes_true([&] { return row(item).value(key, -1) == value; });
  }
  [[nodiscard]] std::string hash_of(const std::string& item) const {
    const ProcessResult result = run({"report", "--hash-of", path(item)});
    return result.out.substr(0, result.out.find(' '));
  }
};

TEST_F(Report, CountsTheItemsThatPlayersHavePlayed) {
  write_list();
  play_once({"--proof", "journal", "--loop", "2"});
  ASSERT_TRUE(row_has("b.lts", "plays", 4));
  EXPECT_EQ(row("b.lts")["frames"], 48);
  EXPECT_EQ(row("b.lts")["whole"], 4);
  EXPECT_EQ(row("b.lts")["panel"], "virtual");
  EXPECT_EQ(row("a.lts")["plays"], 2);
  EXPECT_EQ(row("a.lts")["frames"], 60);
  play_once({"--proof", "journal"});
  ASSERT_TRUE(row_has("b.lts", "plays", 6)) << "a second player adds its plays";
  const json all = reported();
  EXPECT_EQ(all["total"]["plays"], 9);
  EXPECT_EQ(all["total"]["interrupted"], 0);
  EXPECT_TRUE(all["playing"].empty());
  EXPECT_TRUE(all["without_end"].empty());
  EXPECT_EQ(reported({"--item", "a*"})["total"]["plays"], 3);
  EXPECT_EQ(reported({"--until", "2001-01-01"})["total"]["plays"], 0);
  EXPECT_EQ(reported({"--unit", "lenticule-player@lobby"})["total"]["plays"], 0);
  const std::string csv = report({"--csv"}).out;
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3) << csv;
}

TEST_F(Report, SaysHowLongTheSoundOfAnItemWasHeard) {
  write_list();
  play_once({"--proof", "off", "--sound-device", "file:" + path("a.wav")});  // is beside a.lts now
  write("day.toml", "[[item]]\nsource = \"a.lts\"\nloops = 8\n[[item]]\nsource = \"b.lts\"\n");
  play_once({"--proof", "journal", "--sound-device", "file:" + path("out.wav")});
  ASSERT_TRUE(row_has("a.lts", "plays", 8));
  const json sound = row("a.lts")["sound"];
  EXPECT_GT(sound["heard_s"], 0.0) << sound;
  EXPECT_EQ(sound["devices"], json::array({"file:" + path("out.wav")}));
  EXPECT_FALSE(row("b.lts").contains("sound"));
}

TEST_F(Report, NamesTheItemThatAKilledPlayerWasPlaying) {
  write_sequence(path("long.lts"), path("rig.toml"), 0, 6);
  write_list("[[item]]\nsource = \"long.lts\"\nloops = " + std::to_string(kLongFilm) + "\n");
  play(path("day.toml"), {"--proof", "journal"});
  ASSERT_TRUE(row_has("b.lts", "whole", 2));
  ASSERT_TRUE(comes_true([this] {
    const json playing = reported()["playing"];
    return playing.size() == 1 && playing[0]["item"] == path("long.lts");
  }));
  EXPECT_TRUE(row("long.lts").empty()) << "no play before its end";
  player_->signal(SIGKILL);
  (void)player_->wait(kPlayerTimeout);
  const json after = reported();
  EXPECT_TRUE(after["playing"].empty());
  ASSERT_EQ(after["without_end"].size(), 1u);
  EXPECT_EQ(after["without_end"][0]["item"], path("long.lts"));
  EXPECT_EQ(row("long.lts")["interrupted"], 1);
  EXPECT_EQ(row("a.lts")["whole"], 1);
  const std::string text = report().out;
  EXPECT_NE(text.find("interrupted: " + path("long.lts")), std::string::npos) << text;
}

TEST_F(Report, StatesTheHashOfEachItemAndTheOneThatTheEndOfThePlayerInterrupts) {
  write_list();
  play(path("day.toml"), {"--proof", "journal", "--loop", "forever"});
  const json hash = json::array({hash_of("a.lts")});
  EXPECT_TRUE(hash[0].get<std::string>().starts_with("lts-sha256:")) << hash;
  ASSERT_TRUE(comes_true([&] { return row("a.lts").value("hashes", json()) == hash; }));
  (void)quit();
  ASSERT_TRUE(comes_true([this] { return reported()["total"]["interrupted"] == 1; }));
  EXPECT_TRUE(reported()["without_end"].empty());
  EXPECT_TRUE(reported()["playing"].empty());
}

TEST_F(Report, EntriesOfOtherProgramsAreApartAndWrongOnesAreIgnored) {
  write_list();
  play_once({"--proof", "journal"});
  ASSERT_TRUE(row_has("a.lts", "plays", 1));
  const std::string forge = "MESSAGE_ID=b2a79d9bb7a94b0dbb48d11c4fec1786\nMESSAGE=forged\n";
  std::string fields =
      forge + "LENTICULE_EVENT=ended\nLENTICULE_ITEM=" + path("a.lts") +
      "\nLENTICULE_PANEL=p\nLENTICULE_EXACTNESS=yes\nLENTICULE_SESSION=" + std::string(32, 'a') +
      "\nLENTICULE_FROM_USEC=1792843200000000"
      "\nLENTICULE_UNTIL_USEC=1792843200000000\n";
  for (const char* const name : {"TURN", "FRAMES_SHOWN", "FRAMES_UNSEEN", "MISSED", "DAMAGED",
                                 "PLAYS_WHOLE", "PLAYS_INTERRUPTED", "PROCESS_START"})
    fields += std::string("LENTICULE_") + name + "=1000\n";
  write("forged", fields);
  write("wrong", forge);
  for (const char* const name : {"forged", "wrong"})
    EXPECT_EQ(run_process(
                  journal->inside({"/bin/sh", "-c", "logger --journald <\"$1\"", "sh", path(name)}))
                  .exit_code,
              0);
  ASSERT_TRUE(comes_true([this] { return reported()["ignored_entries"] == 1; }));
  EXPECT_EQ(row("a.lts")["plays"], 1) << "the player's row";
  EXPECT_EQ(reported()["total"]["plays"], 2003) << "2000 are forged, in a row of their own";
}

TEST_F(Report, APlayerThatIsNoServiceWritesNothingUnlessAsked) {
  write_list();
  play_once({});
  (void)run_process(journal->inside({"/usr/bin/logger", "done"}));
  ASSERT_TRUE(comes_true([this] { return !journal->folder().empty(); }));
  EXPECT_EQ(report().out, "no plays are recorded for this time\n");
}

TEST_F(Report, EntriesThatNoJournalTakesAreCountedAsLostAndReportedOnce) {
  const ProcessResult played = run_process({"/usr/bin/unshare",
                                            ::geteuid() == 0 ? "-m" : "-rm",
                                            "/bin/sh",
                                            "-c",
                                            "mount -t tmpfs none /run && exec \"$@\"",
                                            "sh",
                                            LENTICULE_PROGRAM,
                                            "play",
                                            "card",
                                            "--rig",
                                            path("rig.toml"),
                                            "--display",
                                            "virtual:48x32@60",
                                            "--duration",
                                            "1",
                                            "--proof",
                                            "journal",
                                            "--stats",
                                            path("stats.json"),
                                            "--json"});
  expect_end(played, 0, "proof of play: the journal");
  const json proof = json::parse(played.out)["proof"];
  EXPECT_EQ(proof["entries"], 0);
  EXPECT_GE(proof["lost"], 1);
}

TEST_F(Report, ErrorsNameTheObjectAndTheRemedy) {
  expect_end(run({"report", "--since", "now"}), 2, "--since 'now': not a time");
  expect_end(run({"report", "--directory", path("missing")}), 4, path("missing"));
  expect_end(run({"report", "--hash-of", "card"}), 2);
  expect_end(run({"play", path("a.lts"), "--rig", path("rig.toml"), "--display", "virtual:48x32@60",
                  "--clock", "simulated", "--proof", "journal"}),
             2);
}

}  // namespace
}  // namespace lenticule::test
