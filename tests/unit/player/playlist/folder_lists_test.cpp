// SPDX-License-Identifier: Apache-2.0
// Tests which files of a folder are played, and from when on.
#include "player/playlist/folder_lists.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

class FolderWatchTest : public testing::Test {
 protected:
  test::ScratchFolder scratch;
  const std::string folder = (scratch / "films").string() + "/";
  FolderWatch::Time now = std::chrono::steady_clock::now();

  void SetUp() override { fs::create_directory(folder); }
  void write(const std::string& name, const std::string& text = "content") const {
    std::ofstream(folder + name) << text;
  }
  /// Sets the time of the last change of a file back by a minute.
  void age(const std::string& name) const {
    fs::last_write_time(folder + name, fs::file_time_type::clock::now() - std::chrono::minutes(1));
  }
};

TEST(FolderNames, OnlyContentIsPlayed) {
  for (const char* name :
       {"a.lts", "b.mp4", "c.PNG", "quilt_qs8x6a0.75.mkv", "d.jps", "IMG_1.HEIC", "e.avif"})
    EXPECT_TRUE(may_be_content(name)) << name;
  for (const char* name : {"", ".a.lts.Xy12Zw", "a.lts.part", "film.mp4.part", "b.mp4.crdownload",
                           "a.lts~", "notes.txt", "quilt.json", "list.toml", "a"})
    EXPECT_FALSE(may_be_content(name)) << name;
}

TEST_F(FolderWatchTest, FilesThatWereThereAreWholeUnlessTheyAreNew) {
  for (const char* name : {"b.lts", "a.lts", "c.lts"}) write(name);
  age("a.lts");
  age("b.lts");
  FolderWatch watch(folder, now);
  EXPECT_THAT(watch.whole_files(now), ElementsAre("a.lts", "b.lts"));
  EXPECT_THAT(watch.whole_files(now + seconds(3)), ElementsAre("a.lts", "b.lts", "c.lts"));
}

TEST_F(FolderWatchTest, NamesAreInTheOrderOfTheirNumbers) {
  for (const char* name : {"a10.lts", "a9.lts", "a2b.lts", "a2.lts", "b1.lts"}) {
    write(name);
    age(name);
  }
  FolderWatch watch(folder, now);
  EXPECT_THAT(watch.whole_files(now),
              ElementsAre("a2.lts", "a2b.lts", "a9.lts", "a10.lts", "b1.lts"));
}

TEST_F(FolderWatchTest, AFileIsWholeWhenItsWriterClosesIt) {
  FolderWatch watch(folder, now);
  std::ofstream file(folder + "a.lts");
  file << "half" << std::flush;
  EXPECT_THAT(watch.whole_files(now), IsEmpty());
  EXPECT_THAT(watch.whole_files(now + seconds(20)), IsEmpty()) << "a stick may pause";
  file << "whole";
  file.close();
  EXPECT_THAT(watch.whole_files(now + seconds(21)), ElementsAre("a.lts"));
}

TEST_F(FolderWatchTest, AFileOfAWriterThatDisappearedIsWholeAfterHalfAMinute) {
  FolderWatch watch(folder, now);
  std::ofstream file(folder + "a.lts");
  file << "all" << std::flush;
  EXPECT_THAT(watch.whole_files(now), IsEmpty());
  EXPECT_THAT(watch.whole_files(now + FolderWatch::kAbandoned), ElementsAre("a.lts"));
}

TEST_F(FolderWatchTest, AFileThatIsMovedIntoTheFolderIsWholeAtOnce) {
  FolderWatch watch(folder, now);
  write(".a.lts.Xy12Zw");
  EXPECT_THAT(watch.whole_files(now + seconds(60)), IsEmpty());
  fs::rename(folder + ".a.lts.Xy12Zw", folder + "a.lts");
  EXPECT_THAT(watch.whole_files(now + seconds(60)), ElementsAre("a.lts"));
}

TEST_F(FolderWatchTest, AFileThatIsWrittenAgainLeavesUntilItIsWhole) {
  write("a.lts");
  age("a.lts");
  FolderWatch watch(folder, now);
  EXPECT_THAT(watch.whole_files(now), ElementsAre("a.lts"));
  std::ofstream file(folder + "a.lts");
  file << "half" << std::flush;
  EXPECT_THAT(watch.whole_files(now + seconds(5)), IsEmpty());
  file.close();
  EXPECT_THAT(watch.whole_files(now + seconds(6)), ElementsAre("a.lts"));
}

TEST_F(FolderWatchTest, AnEmptyFileIsNotContentYet) {
  FolderWatch watch(folder, now);
  write("a.lts", "");
  EXPECT_THAT(watch.whole_files(now + seconds(60)), IsEmpty());
}

TEST_F(FolderWatchTest, AFolderThatIsGoneIsEmptyUntilItIsBack) {
  write("a.lts");
  age("a.lts");
  FolderWatch watch(folder, now);
  fs::rename(folder, scratch / "away");
  EXPECT_THAT(watch.whole_files(now), IsEmpty());
  fs::rename(scratch / "away", folder);
  EXPECT_THAT(watch.whole_files(now + seconds(1)), IsEmpty());
  EXPECT_THAT(watch.whole_files(now + seconds(3)), ElementsAre("a.lts"));
  write("b.lts");
  EXPECT_THAT(watch.whole_files(now + seconds(3)), ElementsAre("a.lts", "b.lts"))
      << "the folder is watched again";
}

TEST_F(FolderWatchTest, TheListHasTheFilesInOrderAndItsMarkFollowsTheirNames) {
  for (const char* name : {"b.lts", "a.png"}) write(name);
  age("a.png");
  age("b.lts");
  FolderLists lists;
  const Playlist list = lists.read(folder);
  ASSERT_EQ(list.items.size(), 2u);
  EXPECT_EQ(list.items[0].source.text, folder + "a.png");
  EXPECT_EQ(list.items[0].still_s, kStillSeconds);
  EXPECT_EQ(list.items[1].source.kind, SourceKind::Sequence);
  EXPECT_EQ(list.rounds, kForever);
  EXPECT_TRUE(list.awaits_files);
  EXPECT_EQ(lists.mark(folder), list.file);
  write("c.lts");
  EXPECT_NE(lists.mark(folder), list.file);
  fs::remove(folder + "c.lts");
  EXPECT_EQ(lists.mark(folder), list.file);
}

TEST_F(FolderWatchTest, TheFirstListMayWaitForFilesThatWereCopiedJustNow) {
  write("a.lts");
  FolderLists at_once;
  EXPECT_THAT(at_once.read(folder).items, IsEmpty());
  EXPECT_THAT(at_once.unfinished_files(), ElementsAre(folder + "a.lts"));
  FolderLists patient(2 * FolderWatch::kQuiet);
  EXPECT_EQ(patient.read(folder).items.size(), 1u);
  EXPECT_THAT(patient.unfinished_files(), IsEmpty());
}

/// Returns a list in a file that plays an advertisement between two rounds of the folder.
Playlist list_with(const std::string& folder, const fs::path& file) {
  std::ofstream(file) << "format = 1\n[[item]]\nsource = \"" << folder
                      << "\"\nloops = 2\n[[item]]\nsource = \"/ad.lts\"\n[[item]]\nsource = \""
                      << folder << "\"\n";
  return load_playlist(file);
}

std::vector<std::string> sources_of(const Playlist& list) {
  std::vector<std::string> names;
  for (const PlaylistItem& item : list.items) names.push_back(item.source.text);
  return names;
}

TEST_F(FolderWatchTest, AFolderInAListIsReplacedByItsFilesWithTheItemsSettings) {
  for (const char* name : {"b.lts", "a.png"}) write(name);
  age("a.png");
  age("b.lts");
  std::ofstream(folder + "a.png.json") << R"({"columns": 2, "rows": 1, "duration": 4})";
  FolderLists lists;
  const Playlist list = lists.with_files(list_with(folder, scratch / "day.toml"));
  EXPECT_THAT(sources_of(list), ElementsAre(folder + "a.png", folder + "b.lts", "/ad.lts",
                                            folder + "a.png", folder + "b.lts"));
  EXPECT_EQ(list.items[1].loops, 2u);
  EXPECT_EQ(list.items[1].source.kind, SourceKind::Sequence);
  EXPECT_EQ(list.items[0].still_s, std::nullopt) << "loops come before the sidecar";
  EXPECT_EQ(list.items[3].still_s, 4.0) << "the sidecar's duration";
  EXPECT_EQ(list.items[4].still_s, kStillSeconds);
  EXPECT_FALSE(list.awaits_files);
}

TEST_F(FolderWatchTest, TheMarkOfAListFollowsItsFileAndTheFilesOfItsFolders) {
  write("a.lts");
  age("a.lts");
  FolderLists lists;
  const std::string file = scratch / "day.toml";
  const Playlist list = lists.with_files(list_with(folder, file));
  EXPECT_EQ(lists.mark(file), list.file);
  write("b.lts");
  EXPECT_NE(lists.mark(file), list.file);
  fs::remove(folder + "b.lts");
  EXPECT_EQ(lists.mark(file), list.file);
  fs::remove(folder + "a.lts");
  EXPECT_NE(lists.mark(file), list.file);
  std::ofstream(file) << "format = 1\n[[item]]\nsource = \"a.lts\"\n";
  const Playlist without = lists.with_files(load_playlist(file));
  EXPECT_EQ(lists.mark(file), without.file);
  EXPECT_EQ(without.file, mark_of(file));
}

TEST_F(FolderWatchTest, AListOfAMissingFolderIsBlackUntilTheFolderHasFiles) {
  fs::remove(folder);
  const std::string file = scratch / "day.toml";
  std::ofstream(file) << "format = 1\n[[item]]\nsource = \"films/\"\n";
  FolderLists lists;
  const Playlist list = lists.with_files(load_playlist(file));
  EXPECT_THAT(sources_of(list), IsEmpty());
  EXPECT_TRUE(list.awaits_files);
  EXPECT_EQ(lists.mark(file), list.file);
  fs::create_directory(folder);
  write("a.lts");
  age("a.lts");
  EXPECT_NE(lists.mark(file), list.file);
  EXPECT_THAT(sources_of(lists.with_files(load_playlist(file))), ElementsAre(folder + "a.lts"));
}

TEST_F(FolderWatchTest, AListHasAtMostItsItemsWithTheFilesOfItsFolders) {
  for (size_t k = 0; k < kMaxPlaylistItems / 2; ++k) {
    const std::string name = std::to_string(k) + ".png";
    write(name);
    age(name);
  }
  FolderLists lists;
  EXPECT_THROW((void)lists.with_files(list_with(folder, scratch / "day.toml")), Error);
}

}  // namespace
}  // namespace lenticule::player
