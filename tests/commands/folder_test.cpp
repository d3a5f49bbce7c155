// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule play FOLDER/` while films are added, replaced, broken and removed.
#include "tests/commands/player_stage.h"
#include "tests/commands/sequence_films.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

namespace fs = std::filesystem;

class Folder : public PlayerTest {
 protected:
  void SetUp() override {
    PlayerTest::SetUp();
    fs::create_directory(path("films"));
  }
  /// Puts a film into the folder as rsync does: under a hidden name first.
  void put(const std::string& name, uint8_t level, const std::string& rig = "rig.toml") const {
    write_sequence(path("new.lts"), path(rig), level);
    fs::rename(path("new.lts"), path("films/." + name + ".Xy12Zw"));
    fs::rename(path("films/." + name + ".Xy12Zw"), path("films/" + name));
  }
  void play() {
    std::vector<std::string> words = play_words(path("films/"));
    words.insert(words.end(), {"--stats", path("stats.json")});
    start(words);
  }
  /// Returns the names of the listed items.
  [[nodiscard]] std::vector<std::string> items() const {
    const json list = asked({"list"});
    std::vector<std::string> names;
    for (const json& item : list.value("items", json::array()))
      names.push_back(fs::path(item["source"].get<std::string>()).filename());
    return names;
  }
  [[nodiscard]] bool has_items(const std::vector<std::string>& names) const {
    return comes_true([&] { return items() == names; });
  }
  [[nodiscard]] bool is_shown(const std::string& name) const {
    return comes_true([&] { return says_about("displayed", path("films/" + name)); });
  }
  /// Ends the player and returns its standard error.
  [[nodiscard]] std::string messages() { return quit().err; }
};

/// Returns how often `text` occurs in `all`.
size_t count_of(const std::string& all, const std::string& text) {
  size_t count = 0;
  for (size_t at = all.find(text); at != std::string::npos; at = all.find(text, at + 1)) ++count;
  return count;
}

TEST_F(Folder, FilmsJoinInTheOrderOfTheirNamesAndLeaveWhenTheyAreRemoved) {
  play();
  EXPECT_TRUE(comes_true([this] { return says_about("displayed", "black"); }))
      << "an empty folder is black";
  put("b.lts", 20);
  EXPECT_TRUE(is_shown("b.lts"));
  put("a.lts", 10);
  put("c.lts", 30);
  ASSERT_TRUE(has_items({"a.lts", "b.lts", "c.lts"}));
  for (const char* name : {"a.lts", "b.lts", "c.lts"}) EXPECT_TRUE(is_shown(name)) << name;
  fs::remove(path("films/b.lts"));
  ASSERT_TRUE(has_items({"a.lts", "c.lts"}));
  for (const char* name : {"a.lts", "c.lts", "a.lts"}) EXPECT_TRUE(is_shown(name)) << name;
  fs::remove(path("films/a.lts"));
  fs::remove(path("films/c.lts"));
  EXPECT_TRUE(comes_true([this] { return says_about("displayed", "black"); }));
  const std::string said = messages();
  EXPECT_EQ(count_of(said, "left out"), 0u) << said;
  EXPECT_EQ(count_of(said, "was replaced"), 0u) << said;
  EXPECT_EQ(count_of(said, path("films/") + ": 3 files to play"), 1u) << said;
}

TEST_F(Folder, AListPlaysTheFilesOfAFolderAsTheyAreAndThenGoesOn) {
  put("a.lts", 10);
  write_sequence(path("last.lts"), path("rig.toml"), 90);
  write("day.toml",
        "format = 1\nloop = \"forever\"\n[[item]]\nsource = \"films/\"\n[[item]]\nsource = "
        "\"last.lts\"\n");
  start(play_words(path("day.toml")));
  ASSERT_TRUE(is_shown("a.lts"));
  EXPECT_EQ(items(), (std::vector<std::string>{"a.lts", "last.lts"}));
  EXPECT_TRUE(comes_true([this] { return says_about("displayed", path("last.lts")); }));
  put("b.lts", 20);
  ASSERT_TRUE(has_items({"a.lts", "b.lts", "last.lts"}));
  EXPECT_TRUE(is_shown("b.lts"));
  fs::remove(path("films/a.lts"));
  fs::remove(path("films/b.lts"));
  ASSERT_TRUE(has_items({"last.lts"}));
  EXPECT_TRUE(film_continues());
  EXPECT_EQ(count_of(messages(), "left out"), 0u);
}

TEST_F(Folder, AReplacedFilmIsPlayedInItsNewVersion) {
  put("a.lts", 10);
  play();
  ASSERT_TRUE(is_shown("a.lts"));
  put("a.lts", 100);
  EXPECT_TRUE(comes_true([this] { return displayed_level() >= 100; }));
}

TEST_F(Folder, AFilmThatIsStillWrittenWaitsForItsEnd) {
  put("a.lts", 10);
  write_sequence(path("whole.lts"), path("rig.toml"), 50);
  play();
  ASSERT_TRUE(is_shown("a.lts"));
  const std::string bytes = read_text(path("whole.lts"));
  std::ofstream copy(path("films/b.lts"), std::ios::binary);
  copy << bytes.substr(0, bytes.size() / 2) << std::flush;
  EXPECT_TRUE(film_continues(200));
  EXPECT_EQ(items(), std::vector<std::string>{"a.lts"});
  copy << bytes.substr(bytes.size() / 2);
  copy.close();
  EXPECT_TRUE(is_shown("b.lts"));
  EXPECT_EQ(count_of(messages(), "left out"), 0u);
}

TEST_F(Folder, ABrokenFilmAndOneOfAnotherRigAreReportedOnceWithTheRemedy) {
  put("a.lts", 10);
  play();
  ASSERT_TRUE(is_shown("a.lts"));
  write("broken.lts", "no film");
  fs::rename(path("broken.lts"), path("films/broken.lts"));
  std::string text = read_text(path("rig.toml"));
  const size_t slant = text.find("slant = 0.25");
  ASSERT_NE(slant, std::string::npos);
  text.replace(slant, 12, "slant = 0.20");
  write("other.toml", text);
  put("other.lts", 60, "other.toml");
  ASSERT_TRUE(has_items({"a.lts", "broken.lts", "other.lts"}));
  const int rounds = status().value("rounds_done", 0);
  EXPECT_TRUE(comes_true([&] { return status().value("rounds_done", 0) >= rounds + 3; }));
  EXPECT_EQ(status().value("items_skipped", 0), 2);
  EXPECT_TRUE(is_shown("a.lts"));
  EXPECT_NE(status().value("last_problem", ""), "");
  fs::remove(path("films/broken.lts"));
  fs::remove(path("films/other.lts"));
  EXPECT_TRUE(comes_true([this] { return status().value("last_problem", "") == ""; }))
      << "the problem of a list ends with it: " << status();
  const std::string said = messages();
  EXPECT_EQ(count_of(said, "left out: " + path("films/broken.lts")), 1u) << said;
  EXPECT_EQ(count_of(said, "left out: " + path("films/other.lts")), 1u) << said;
  EXPECT_NE(said.find("--reweave"), std::string::npos) << said;
}

TEST_F(Folder, AnEmptyFolderSaysThatItWaits) {
  play();
  EXPECT_TRUE(comes_true([this] { return says_about("reason", "no file to play yet"); }));
  EXPECT_EQ(count_of(messages(), path("films/") + ": no file to play yet"), 1u);
  expect_end(run_process(play_words(path("films/"), {"--duration", "0.1"})), 4,
             "no file to play yet");
}

TEST_F(Folder, FilesThatWereCopiedJustNowAreExaminedAndPlayedInSimulatedTime) {
  write_picture("films/a.png", 10);
  const std::vector<std::string> words = {"play", path("films/"), "--rig", path("rig.toml")};
  std::vector<std::string> preflight = words, simulated = words;
  preflight.insert(preflight.end(), {"--preflight", "--json"});
  simulated.insert(simulated.end(),
                   {"--display", "virtual", "--clock", "simulated", "--duration", "15", "--json"});
  const json rows = results_of(run(preflight));
  ASSERT_EQ(rows.size(), 1u) << "only the folder's files: " << rows;
  EXPECT_EQ(rows[0]["source"], path("films/a.png"));
  write_picture("films/b.png", 20);
  write("films/c.png", "");
  EXPECT_EQ(results_of(run(simulated))["playlist"]["items_started"], 2);
  const ProcessResult unfinished = run(preflight);
  EXPECT_EQ(unfinished.exit_code, 4);
  EXPECT_NE(unfinished.out.find("still being written"), std::string::npos) << unfinished.out;
}

TEST_F(Folder, APictureOfAnotherSizeIsExaminedWithTheRemedyOfPlaying) {
  write_picture("films/photo.png", 10, {.width = 20, .height = 10});
  const ProcessResult examined =
      run({"play", path("films/"), "--rig", path("rig.toml"), "--preflight", "--json"});
  EXPECT_EQ(examined.exit_code, 4) << examined.err;
  EXPECT_NE(examined.out.find("use --grid 1x1, or _qs1x1 in its name"), std::string::npos)
      << examined.out;
}

TEST_F(Folder, AMissingFolderIsAnError) {
  expect_end(run_process(play_words(path("gone/"))), 4, "no such folder");
}

}  // namespace
}  // namespace lenticule::test
