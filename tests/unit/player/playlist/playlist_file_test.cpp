// SPDX-License-Identifier: Apache-2.0
// Tests the playlist reader, and which item is scheduled at which time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <vector>

#include "base/error.h"
#include "player/playlist/playlist.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

Playlist parse(const std::string& text) { return parse_playlist(text, "list.toml", "/films"); }

std::string complaint(const std::string& text) {
  try {
    (void)parse(text);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return error.what();
  }
  return "none";
}

TEST(PlaylistOrder, AListWithoutItemsWaitsForThem) {
  Playlist list;
  EXPECT_EQ(next_item(list, std::nullopt, 0, {}).kind, NextItem::Kind::None);
  EXPECT_EQ(next_item(list, 3, 0, {}).kind, NextItem::Kind::None);
  EXPECT_EQ(reason_to_wait(list, {}), "no file to play yet");
}

TEST(PlaylistFile, ReadsTheListsOfOtherPlayers) {
  const Playlist list = parse_playlist(
      "\xEF\xBB\xBF#EXTM3U\r\n#EXTINF:12.5,City\r\ncity_qs8x6.png\r\n\r\n#EXTINF:-1\r\n/b/c.mp4",
      "list.M3U8", "/films");
  ASSERT_EQ(list.items.size(), 2u);
  EXPECT_EQ(list.items[0].source.text, "/films/city_qs8x6.png");
  EXPECT_EQ(list.items[0].still_s, 12.5);
  EXPECT_EQ(list.items[1].source.text, "/b/c.mp4");
  EXPECT_EQ(list.items[1].still_s, kStillSeconds);
  EXPECT_EQ(list.rounds, kForever);
  for (const auto& [text, line] :
       {std::pair("#EXTM3U\n", "1"), {"a.png\n\nother.toml\n", "3"}, {"a.png\nv4l2:\n", "2"}}) {
    try {
      (void)parse_playlist(text, "list.m3u", "/films");
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).rfind(std::string("list.m3u:") + line, 0), 0u);
    }
  }
}

TEST(PlaylistFile, ReadsFileUrisInM3u) {
  const auto first = [](const std::string& line) {
    return parse_playlist(line + "\n", "list.m3u", "/films").items.front().source.text;
  };
  EXPECT_EQ(first("file:///b/my%20film_qs8x6.png"), "/b/my film_qs8x6.png");
  EXPECT_EQ(first("file://localhost/b/%C3%A4.png"), "/b/\xC3\xA4.png");
  EXPECT_EQ(first("my%20film.png"), "/films/my%20film.png") << "a name, not a URI";
  for (const char* const line : {"http://host/a.mp4", "file://host/a.png"})
    EXPECT_THAT(test::error_of([&] { (void)first(line); }).what(),
                testing::StartsWith("list.m3u:1: not a file of this computer"));
}

TEST(PlaylistFile, ReadsTheListOfALookingGlassStudio) {
  const test::ScratchFolder folder;
  std::ofstream(folder / "a_qs8x6.png.json")
      << R"({"quilt_settings": {"viewX": 8, "viewY": 6}, "duration": 4.5})";
  std::ofstream(folder / "broken.png.json") << "{";
  const auto read = [&](const char* json) {
    return parse_playlist(json, "playlist.json", folder.path());
  };
  const Playlist list = read(R"([{"filename": "a_qs8x6.png", "needs_sync": false},
      {"filename": "b.mp4"}, {"filename": "broken.png"}])");
  ASSERT_EQ(list.items.size(), 3u);
  EXPECT_EQ(list.items[0].source.text, folder / "a_qs8x6.png");
  EXPECT_EQ(list.items[0].still_s, 4.5) << "from its sidecar";
  EXPECT_EQ(list.items[1].source.text, folder / "b.mp4");
  EXPECT_EQ(list.items[2].still_s, kStillSeconds);
  EXPECT_EQ(list.rounds, kForever);
  const std::pair<const char*, const char*> wrong[] = {
      {"[]", "playlist.json: no list of files"},
      {"{", "playlist.json: "},
      {"{}", "playlist.json: playlists"},
      {R"([{"filename": "a.png"}, {"file": 3}])", "playlist.json: entry 2: filename"},
      {R"([{"filename": "b.toml"}])", "playlist.json: entry 1: source: a list cannot"},
      {R"([7])", "playlist.json: entry 1"},
      {R"({"playlists": [{"path": "a.json"}]})", "playlist.json: entry 1: path: 'a.json' is not"}};
  for (const auto& [json, message] : wrong)
    EXPECT_THAT(test::error_of([&, text = json] { (void)read(text); }).what(),
                testing::StartsWith(message))
        << json;
}

TEST(PlaylistFile, PathsOnTheStorageOfADisplayCountFromItsRoot) {
  const test::ScratchFolder storage;
  std::filesystem::create_directories(storage / "LKG/Content/608");
  std::ofstream(storage / "LKG/Content/608/a_qs8x6.png") << "x";
  std::ofstream(storage / "LKG/Content/608/list.m3u")
      << "/LKG/Content/608/a_qs8x6.png\nb_qs8x6.png\n";
  for (const char* const file : {"currentlyPlaying.json", "LKG/currentlyPlaying.json"}) {
    std::ofstream(storage / file) << R"({"model": "toolkit", "schema": "0.1", "playlists": [
        {"title": "Go", "path": "/LKG/Content/608/list.m3u"}]})";
    const Playlist list = load_playlist(storage / file);
    ASSERT_EQ(list.items.size(), 2u);
    EXPECT_EQ(list.items[0].source.text, storage / "LKG/Content/608/a_qs8x6.png");
    EXPECT_EQ(list.items[1].source.text, storage / "LKG/Content/608/b_qs8x6.png");
  }
}

TEST(PlaylistFile, ReadsEveryKey) {
  const Playlist list = parse(R"(format = 1
loop = "forever"
[default]
source = "card"
[[item]]
source = "a/%05d.png"
loops = 3
fps = "23.976"
frames = "2:9"
[[item]]
source = "/b.png"
duration_s = 2.5
cut = "primed"
wait_s = 3
[item.schedule]
days = ["mon", "sun"]
from = "22:00"
to = "02:30"
[[item]]
source = "ring:/run/ring.sock"
loops = "forever"
)");
  EXPECT_EQ(list.rounds, kForever);
  ASSERT_TRUE(list.standby);
  EXPECT_EQ(list.standby->source.text, "card");
  ASSERT_EQ(list.items.size(), 3u);
  EXPECT_EQ(list.items[0].source.text, "/films/a/%05d.png");
  EXPECT_EQ(list.items[0].loops, 3u);
  EXPECT_EQ(list.items[0].rate, (frames::Rate{24000, 1001}));
  EXPECT_EQ(list.items[0].frames, (FrameRange{2, 9}));
  EXPECT_EQ(list.items[1].source.text, "/b.png");
  EXPECT_EQ(list.items[1].duration_s, 2.5);
  EXPECT_EQ(list.items[1].wait_s, 3.0);
  EXPECT_TRUE(list.items[1].waits_until_primed);
  EXPECT_EQ(list.items[1].schedule, (Schedule{0x41, 22 * 60, 2 * 60 + 30}));
  EXPECT_EQ(list.items[2].loops, kForever);
  EXPECT_EQ(list.items[2].source.text, "ring:/run/ring.sock");
}

TEST(PlaylistFile, TheTransitionOfAnItemIsThatOfTheListUnlessItStatesOne) {
  const Playlist list = parse(R"(transition = "cross"
transition_seconds = 1
[[item]]
source = "/a.lts"
[[item]]
source = "/b.lts"
transition = "cut"
)");
  EXPECT_EQ(list.transition_to(list.items[0]), TransitionKind::Cross);
  EXPECT_EQ(list.transition_s, 1.0);
  EXPECT_EQ(list.transition_to(list.items[1]), TransitionKind::Cut);
  EXPECT_TRUE(list.has_transitions());
  EXPECT_FALSE(parse("[[item]]\nsource = \"/a.lts\"\n").has_transitions());
}

TEST(PlaylistFile, TheSoundOfTheListIsUnderAllItemsAndItsDefault) {
  const std::string items = "[default]\nsource = \"card\"\n[[item]]\nsource = \"/a.lts\"\n";
  const Playlist list = parse("sound = \"bed.flac\"\nsound_volume = -12\n" + items);
  EXPECT_EQ(list.bed, (SoundBed{"/films/bed.flac", -12.0}));
  EXPECT_EQ(list.items[0].bed, list.bed);
  EXPECT_EQ(list.standby->bed, list.bed);
  EXPECT_EQ(list.items[0].sound, "") << "that of the item itself";
  EXPECT_EQ(parse("sound = \"none\"\n" + items).items[0].bed, SoundBed{});
}

TEST(PlaylistFile, AnItemHasTheOverlaysOfTheListAndItsOwn) {
  const Playlist list = parse(R"(
[[overlay]]
picture = "logo.png"
height = 0.08
[default]
source = "card"
[[item]]
source = "a.lts"
[[item]]
source = "b.lts"
[[item.overlay]]
text = "Room 2"
at = "top left"
from_s = 5
for_s = 10
)");
  const OverlaySpec logo{.content = "/films/logo.png", .height = 0.08};
  EXPECT_EQ(list.overlays, std::vector{logo});
  EXPECT_EQ(list.standby->overlays, std::vector{logo});
  EXPECT_EQ(list.items[0].overlays, std::vector{logo});
  const OverlaySpec text{.kind = OverlaySpec::Kind::Text,
                         .content = "Room 2",
                         .place = 0,
                         .from_s = 5.0,
                         .for_s = 10.0};
  EXPECT_EQ(list.items[1].overlays, (std::vector{logo, text}));
  EXPECT_EQ(list.items[1].overlays_of_list, 1U);
}

TEST(PlaylistFile, AnItemStatesItsLayoutAsTheFlagsDo) {
  const Playlist list = parse(R"([[item]]
source = "a.png"
grid = "8x6"
views = 45
aspect = 0.75
invert = true
fit = "cover"
[[item]]
depth = "right"
source = "b.mp4"
depth_range = "-2:2"
invert_depth = true
depth_budget = 1
[[item]]
source = "c.png"
depth = "c-depth.png"
zero_plane = "20px"
)");
  const ContentFlags quilt = list.items[0].source.content;
  EXPECT_EQ(quilt, (ContentFlags{.grid = "8x6", .views = 45, .aspect = 0.75, .invert = true}));
  EXPECT_EQ(list.items[0].fit, "cover");
  EXPECT_EQ(list.items[0].source.kind, SourceKind::Pictures);
  const ContentFlags inside = list.items[1].source.content;
  EXPECT_EQ(inside.depth, "right");
  EXPECT_EQ(inside.depth_range, "-2:2");
  EXPECT_TRUE(inside.invert_depth);
  EXPECT_EQ(inside.depth_budget, 1.0);
  EXPECT_EQ(list.items[2].source.content.depth, "/films/c-depth.png") << "beside the list";
}

TEST(PlaylistFile, ReadsDatesFromTheListOrFromAFile) {
  const test::ScratchFolder folder;
  std::ofstream(folder / "holidays.txt")
      << "# closed\n12-24..12-26  # every year\n\n2027-05-01\r\n";
  const auto read = [&](const std::string& schedule) {
    const std::string list = "[[item]]\nsource = \"a.png\"\nschedule = {" + schedule + "}\n";
    return *parse_playlist(list, "list.toml", folder.path()).items[0].schedule;
  };
  const Schedule from_file = read("except = \"holidays.txt\"");
  ASSERT_EQ(from_file.except.size(), 2u);
  EXPECT_EQ(to_string(from_file.except[0]), "12-24..12-26");
  EXPECT_EQ(to_string(from_file.except[1]), "2027-05-01");
  EXPECT_EQ(from_file, read("except = [\"12-24..12-26\", \"2027-05-01\"]"));
  EXPECT_EQ(read("dates = \"2027-05-01\"").dates, read("dates = [\"2027-05-01\"]").dates);
  std::ofstream(folder / "windows.txt") << "\xEF\xBB\xBF  2027-05-01\r\n";
  EXPECT_EQ(read("dates = \"windows.txt\"").dates, read("dates = [\"2027-05-01\"]").dates);
  std::ofstream(folder / "empty.txt") << "# none\n";
  EXPECT_TRUE(read("except = \"empty.txt\"").except.empty());
  for (const char* const none : {"dates = []", "dates = \"empty.txt\""})
    EXPECT_THAT(test::error_of([&] { (void)read(none); }).what(),
                testing::HasSubstr("list.toml:3: dates: there is none"));
  EXPECT_THAT(test::error_of([&] { (void)read("dates = \"none.txt\""); }).what(),
              testing::AllOf(testing::StartsWith("list.toml:3: "), testing::HasSubstr("none.txt")));
  std::ofstream(folder / "wrong.txt") << "2027-05-01\nsoon\n";
  EXPECT_THAT(test::error_of([&] { (void)read("dates = \"wrong.txt\""); }).what(),
              testing::HasSubstr("wrong.txt:2: 'soon' is no date"));
  for (const char* const text : {"2026-02-29", "13-01", "2026-12-24..12-26", "2026-1-1", "",
                                 "2027-01-02..2027-01-01", "0000-01-01", "12-24..", "2026-12-24x"})
    EXPECT_FALSE(parse_dates(text)) << text;
}

TEST(PlaylistFile, ErrorsNameTheLineAndTheReason) {
  const std::string item = "[[item]]\nsource = \"a.png\"\n";
  EXPECT_EQ(complaint(""), "list.toml:1: no [[item]]");
  EXPECT_THAT(complaint("\n\xC6\x8Dop = 1\n"), testing::HasSubstr(":2: a character outside ASCII"));
  EXPECT_EQ(complaint("# \xC3\xA4\n[[item]]\nsource = \"\\u00e4 \xC3\xA4.png\"\n"), "none");
  EXPECT_THAT(complaint("loop = = 1\n"), testing::StartsWith("list.toml:1: "));
  EXPECT_EQ(complaint(item + "speed = 3\n"), "list.toml:3: unknown key 'speed'");
  EXPECT_EQ(complaint("lop = 1\n" + item), "list.toml:1: unknown key 'lop'");
  EXPECT_EQ(complaint(item + "rig = \"other.toml\"\n"),
            "list.toml:3: rig: not allowed in a list, which is played on one panel");
  EXPECT_THAT(complaint(item + "loops = 0\n"),
              testing::HasSubstr(":3: loops: not a number of loops"));
  EXPECT_THAT(complaint(item + "loops = 1.5\n"),
              testing::HasSubstr(":3: loops: not a number of loops"));
  EXPECT_THAT(complaint(item + "duration_s = -1\n"),
              testing::HasSubstr(":3: duration_s: not a number of s"));
  EXPECT_THAT(complaint(item + "duration_s = nan\n"),
              testing::HasSubstr(":3: duration_s: not a number of s"));
  EXPECT_THAT(complaint(item + "fps = \"fast\"\n"), testing::HasSubstr("list.toml:3: fps: "));
  EXPECT_THAT(complaint(item + "loops = 2\nduration_s = 1\n"), testing::HasSubstr("exclude"));
  EXPECT_THAT(complaint("[[item]]\nsource = \"inner.toml\"\n"), testing::HasSubstr(":2: "));
  EXPECT_THAT(complaint("[[item]]\nloops = 2\n"), testing::HasSubstr("no source"));
  EXPECT_THAT(complaint("item = 3\n"), testing::HasSubstr("list.toml:1: item: not an array"));
  EXPECT_THAT(complaint("format = 2\n" + item), testing::HasSubstr("list.toml:1: format"));
  EXPECT_THAT(complaint("format = 2e41\n" + item), testing::HasSubstr("list.toml:1: format"));
  EXPECT_THAT(complaint("format = 1.0\n" + item), testing::HasSubstr("list.toml:1: format"));
  EXPECT_THAT(complaint(item + "grid = \"8by6\"\n"), testing::HasSubstr(":3: grid: "));
  EXPECT_THAT(complaint(item + "stereo = \"both\"\n"), testing::HasSubstr(":3: stereo: "));
  EXPECT_THAT(complaint(item + "depth_range = \"2\"\n"), testing::HasSubstr(":3: depth_range: "));
  EXPECT_EQ(complaint(item + "depth_range = \"a:b\"\n"),
            "list.toml:3: depth_range: 'a:b': not two disparities");
  EXPECT_THAT(complaint(item + "grid = \"4x0\"\n"),
              testing::HasSubstr(":3: grid: '4x0': not columns x rows"));
  EXPECT_THAT(complaint(item + "depth = \"middle\"\n"),
              testing::HasSubstr(":3: depth: 'middle': neither a side nor a file"));
  EXPECT_EQ(complaint(item + "depth = \"depth.png\"\n"), "none");
  EXPECT_THAT(complaint("[[item]]\nsource = \"v4l2:/dev/video0?size=4\"\n"),
              testing::HasSubstr(":2: source 'v4l2:/dev/video0?size=4': size"));
  EXPECT_THAT(complaint(item + "fit = \"wide\"\n"), testing::HasSubstr(":3: fit: "));
  EXPECT_THAT(complaint(item + "grid = \"2x1\"\nstereo = \"sbs\"\n"),
              testing::HasSubstr("exclude each other"));
  EXPECT_THAT(complaint(item + "views = 0\n"),
              testing::HasSubstr(":3: views: not a whole number from 1"));
  EXPECT_THAT(complaint(item + "invert = 1\n"),
              testing::HasSubstr(":3: invert: neither true nor false"));
  EXPECT_THAT(complaint(item + "weight = 101\n"),
              testing::HasSubstr(":3: weight: not a whole number from 1 to 100"));
  EXPECT_THAT(complaint(item + "transition = \"wipe\"\n"),
              testing::HasSubstr(":3: transition 'wipe': unknown"));
  EXPECT_THAT(complaint("transition_seconds = 11\n" + item),
              testing::HasSubstr(":1: transition_seconds: not a number of seconds"));
  EXPECT_THAT(complaint("transition_seconds = \"x\"\n" + item),
              testing::HasSubstr(":1: transition_seconds: not a number of seconds"));
  EXPECT_THAT(complaint(item + "transition = \"cut\"\ntransition_seconds = 2\n"),
              testing::HasSubstr(":4: transition_seconds: /films/a.png follows by a cut"));
  EXPECT_THAT(complaint(item + "transition_seconds = 2\n"),
              testing::HasSubstr(":3: transition_seconds: /films/a.png follows by a cut"));
  EXPECT_THAT(complaint(item + "transition_seconds = 0\n"),
              testing::HasSubstr(":3: transition_seconds: not a number of seconds"));
  EXPECT_THAT(complaint("sound = 3\n" + item),
              testing::StartsWith("list.toml:1: sound: not a string"));
  EXPECT_THAT(complaint("sound = \"\"\n" + item),
              testing::StartsWith("list.toml:1: sound: not a valid name"));
  EXPECT_THAT(complaint("loop = 2\nsound_volume = 13\n" + item),
              testing::StartsWith("list.toml:2: sound_volume: not a number of decibels"));
  EXPECT_EQ(complaint(item + "overlay = \"logo.png\"\n"),
            "list.toml:3: overlay: not an array of tables");
  EXPECT_THAT(complaint("[[overlay]]\ntext = \"a\"\nfrom_s = -1\n" + item),
              testing::StartsWith("list.toml:1: overlay: from_s: not a number"));
  EXPECT_THAT(complaint(item + "[[item.overlay]]\nclock = 1979-05-27\n"),
              testing::StartsWith("list.toml:3: overlay: clock: not a text"));
  EXPECT_EQ(complaint("overlay = []\n" + item), "none");
  std::string nine = item;
  for (int n = 0; n < 8; ++n) nine += "[[item.overlay]]\ntext = \"a\"\n";
  EXPECT_EQ(complaint(nine), "none");
  EXPECT_THAT(complaint("[[overlay]]\ntext = \"a\"\n" + nine),
              testing::HasSubstr("overlay: /films/a.png has 9, with those of the list"));
  EXPECT_THAT(complaint(item + "aspect = inf\n"),
              testing::HasSubstr(":3: aspect: not a number above 0"));
  EXPECT_THAT(complaint("shuffle = \"yes\"\n" + item),
              testing::HasSubstr(":1: shuffle: not a whole number"));
  EXPECT_THAT(complaint(item + "schedule = {dates = [\"24.12.\"]}\n"),
              testing::HasSubstr(":3: dates: '24.12.' is no date"));
  EXPECT_THAT(complaint(item + "schedule = {days = [\"noday\"]}\n"),
              testing::HasSubstr(":3: days: not a day"));
  EXPECT_THAT(complaint(item + "schedule = {from = \"8:00\"}\n"),
              testing::HasSubstr(":3: from: not a time of day"));
  EXPECT_THAT(complaint(item + "schedule = {from = \"25:00\"}\n"),
              testing::HasSubstr(":3: from: not a time of day"));
  EXPECT_THAT(complaint(item + "schedule = {from = \"08:00\", to = \"08:00\"}\n"),
              testing::HasSubstr("no time in between"));
}

TEST(PlaylistFile, ASpanOverMidnightBelongsToTheDayOnWhichItBegan) {
  const Schedule late{.days = 1u << 4, .from_minute = 22 * 60, .to_minute = 2 * 60};  // Friday
  EXPECT_TRUE(late.permits({4, 22 * 60}));
  EXPECT_TRUE(late.permits({4, 24 * 60 - 1}));
  EXPECT_TRUE(late.permits({5, 0}));
  EXPECT_TRUE(late.permits({5, 2 * 60 - 1}));
  EXPECT_FALSE(late.permits({5, 2 * 60}));
  EXPECT_FALSE(late.permits({4, 60}));
  EXPECT_FALSE(late.permits({5, 22 * 60}));
  const Schedule sunday{.days = 1u << 6, .from_minute = 23 * 60, .to_minute = 60};
  EXPECT_TRUE(sunday.permits({0, 30})) << "Monday's first hour";
}

TEST(PlaylistOrder, SkipsItemsThatAreNotScheduledNow) {
  Playlist list{.name = "l", .items = {}, .standby = {}, .rounds = 2};
  list.items.resize(3);
  list.items[1].schedule = Schedule{.days = 0x7f, .from_minute = 600, .to_minute = 660};
  const LocalTime morning{0, 0};
  EXPECT_EQ(next_item(list, std::nullopt, 0, morning).index, 0u);
  EXPECT_EQ(next_item(list, 0, 0, morning).index, 2u);
  EXPECT_EQ(next_item(list, 0, 0, {0, 600}).index, 1u);
  const NextItem again = next_item(list, 2, 0, morning);
  EXPECT_EQ(again.kind, NextItem::Kind::Item);
  EXPECT_EQ(again.rounds_done, 1);
  EXPECT_EQ(next_item(list, 2, 1, morning).kind, NextItem::Kind::End);
}

LocalTime at(const char* date, int minute) {
  return {.day = day_of(parse_dates(date)->first), .minute = minute};
}

TEST(PlaylistOrder, DatesPermitAndForbid) {
  EXPECT_EQ(at("2026-11-30", 0).weekday(), 0);
  EXPECT_EQ(at("1969-12-28", 0).weekday(), 6);
  const Schedule winter{.from_minute = 22 * 60,
                        .to_minute = 60,
                        .dates = {*parse_dates("12-01..02-29")},
                        .except = {*parse_dates("2026-12-24..2026-12-26")}};
  EXPECT_FALSE(winter.permits(at("2026-11-30", 23 * 60)));
  EXPECT_TRUE(winter.permits(at("2026-12-01", 23 * 60)));
  EXPECT_TRUE(winter.permits(at("2028-02-29", 23 * 60)));
  EXPECT_TRUE(winter.permits(at("2028-03-01", 59))) << "the span began on a permitted day";
  EXPECT_FALSE(winter.permits(at("2028-03-01", 23 * 60)));
  EXPECT_FALSE(winter.permits(at("2026-12-25", 23 * 60)));
  EXPECT_TRUE(winter.permits(at("2027-12-25", 23 * 60)));
}

TEST(PlaylistOrder, NamesTheNextPermittedDate) {
  Playlist list{.name = "l", .items = {}, .standby = {}, .rounds = kForever};
  list.items.resize(1);
  list.items[0].schedule = Schedule{.from_minute = 600, .dates = {*parse_dates("2026-12-24")}};
  EXPECT_EQ(reason_to_wait(list, at("2026-11-29", 700)),
            "no item is scheduled before Thu 2026-12-24 10:00");
  list.items[0].schedule->dates[0] = *parse_dates("2026-12-06");
  EXPECT_EQ(reason_to_wait(list, at("2026-11-29", 700)),
            "no item is scheduled before Sun 2026-12-06 10:00");
  list.items[0].schedule->dates[0] = *parse_dates("2026-12-24");
  EXPECT_EQ(reason_to_wait(list, at("2026-12-23", 700)), "no item is scheduled before Thu 10:00");
  EXPECT_EQ(reason_to_wait(list, at("2026-12-25", 0)), "no item is scheduled any more");
}

/// Returns the sources' indices that are played in the first rounds.
std::vector<std::vector<size_t>> played(const Playlist& list, int64_t rounds) {
  std::vector<std::vector<size_t>> played(static_cast<size_t>(rounds));
  NextItem item = next_item(list, std::nullopt, 0, {});
  for (; item.rounds_done < rounds; item = next_item(list, item.index, item.rounds_done, {}))
    played[static_cast<size_t>(item.rounds_done)].push_back(item.index);
  return played;
}

TEST(PlaylistOrder, AShufflePlaysEachItemOnceARoundAndNoneTwiceInARow) {
  for (const size_t items : {3u, 4u, 17u}) {
    Playlist list{.name = "l", .items = {}, .standby = {}, .rounds = kForever, .shuffle = 7};
    list.items.resize(items);
    const auto rounds = played(list, 200);
    std::set<std::vector<size_t>> orders;
    for (size_t round = 0; round < rounds.size(); ++round) {
      std::vector<size_t> sorted = rounds[round];
      orders.insert(sorted);
      if (round > 0) EXPECT_NE(rounds[round].front(), rounds[round - 1].back());
      const auto here = static_cast<int64_t>(round);
      for (size_t k = 0; k + 1 < items; ++k) {
        EXPECT_EQ(list.beside({sorted[k], here}, 1), (ListPlace{sorted[k + 1], here}));
        EXPECT_EQ(list.beside({sorted[k + 1], here}, -1), (ListPlace{sorted[k], here}));
      }
      const ListPlace last{sorted.back(), here};
      const ListPlace first = list.beside(last, 1);
      EXPECT_EQ(first, (ListPlace{list.order(here + 1).front(), here + 1})) << "the next round";
      EXPECT_EQ(list.beside(first, -1), last) << "and back";
      std::ranges::sort(sorted);
      for (size_t k = 0; k < items; ++k) ASSERT_EQ(sorted.at(k), k);
    }
    EXPECT_GE(orders.size(), items == 3 ? 6u : items == 4 ? 20u : 200u);
    list.shuffle = 8;
    EXPECT_NE(played(list, 200), rounds);
  }
}

TEST(PlaylistOrder, WeightsSpreadTheLighterItemsOverTheRounds) {
  Playlist list{.name = "l", .items = {}, .standby = {}, .rounds = kForever};
  list.items.resize(4);
  list.items[0].weight = 3;
  std::vector<size_t> times(4);
  for (const std::vector<size_t>& round : played(list, 30)) {
    EXPECT_EQ(round.size(), 2u);
    EXPECT_EQ(round.front(), 0u);
    for (const size_t item : round) ++times[item];
  }
  EXPECT_THAT(times, testing::ElementsAre(30, 10, 10, 10));
  list.items[0].weight = 1;
  list.items[2].weight = 3;
  EXPECT_EQ(played(list, 3), (std::vector<std::vector<size_t>>{{0, 2}, {1, 2}, {2, 3}}))
      << "the first item opens";
  list.items[2].weight = 1;
  list.items[0].weight = 3;
  list.shuffle = 7;
  std::optional<size_t> last;
  for (const std::vector<size_t>& round : played(list, 300))
    for (const size_t item : round) {
      EXPECT_NE(item, last);
      last = item;
    }
  list.shuffle.reset();
  list.items[1].weight = 100;
  list.items[0].schedule = Schedule{.from_minute = 600};
  list.items[1].schedule = Schedule{.from_minute = 600};
  EXPECT_EQ(next_item(list, std::nullopt, 0, {}).kind, NextItem::Kind::Item)
      << "a light item is played in a later round if the heavy ones are not scheduled";
}

TEST(PlaylistOrder, NamesTheNextScheduledTimeIfNoItemIsScheduledNow) {
  Playlist list{.name = "l", .items = {}, .standby = {}, .rounds = kForever};
  list.items.resize(2);
  for (PlaylistItem& item : list.items)
    item.schedule = Schedule{.days = 0x7f, .from_minute = 600, .to_minute = 660};
  EXPECT_EQ(next_item(list, 0, 0, {0, 0}).kind, NextItem::Kind::None);
  EXPECT_EQ(reason_to_wait(list, {0, 0}), "no item is scheduled before Mon 10:00");
  EXPECT_EQ(reason_to_wait(list, {6, 660}), "no item is scheduled before Mon 10:00");
  list.items[1].schedule->days = 0x10;
  list.items[0].schedule = Schedule{.days = 0x30, .from_minute = 1320, .to_minute = 120};
  EXPECT_EQ(reason_to_wait(list, {0, 700}), "no item is scheduled before Fri 10:00");
  EXPECT_EQ(reason_to_wait(list, {6, 120}), "no item is scheduled before Fri 10:00");
  EXPECT_EQ(next_item(list, 0, 0, {6, 119}).kind, NextItem::Kind::Item);
  EXPECT_EQ(reason_to_wait(list, {6, 119}), "");
}

}  // namespace
}  // namespace lenticule::player
