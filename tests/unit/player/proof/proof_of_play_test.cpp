// SPDX-License-Identifier: Apache-2.0
// Tests the entries that playing writes: with turns that the test makes, and with whole playbacks
// in simulated time.
#include "player/proof/proof_of_play.h"

#include <gmock/gmock.h>

#include <map>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
#include "tests/unit/player/playlist/fake_items.h"

namespace lenticule::player {
namespace {

using test::kItemSize;
using test::list_of;
using Event = ProofEntry::Event;

constexpr uint64_t kMinuteNs = 60'000'000'000;

/// Writes the entries of turns that are made flip by flip.
class Proof : public testing::Test {
 protected:
  TurnLog turns;
  PaceCounts counts;
  std::map<uint64_t, ItemAccount> accounts;
  std::vector<ProofEntry> entries;
  std::vector<std::string> hashed;
  std::string hash;
  ProofPanel panel{.name = "LGD", .exactness = "yes"};
  ProofOfPlay proof{
      {.session = std::string(32, 'a'),
       .process_start = 3,
       .write = [this](const ProofEntry& entry) { entries.push_back(entry); },
       .account = [this](uint64_t item) -> std::optional<ItemAccount> {
         if (!accounts.contains(item)) return std::nullopt;
         return accounts[item];
       },
       .begin_hash = [this](const SourceSpec& source) { hashed.push_back(source.text); },
       .hash = [this](const SourceSpec& /*source*/) { return hash; },
       .real_time = [](uint64_t ns) { return static_cast<int64_t>(ns / 1000 + 1); }}};

  ItemAccount& account(uint64_t item, const std::string& name) {
    ItemAccount& account = accounts[item];
    account.source = parse_source(name);
    account.to_end = true;
    return account;
  }
  void flip(uint64_t item, uint64_t number, uint64_t time_ns, uint64_t cut = 0) {
    ++counts.shown;
    turns.flipped({.item = item,
                   .number = number,
                   .cut = cut,
                   .time = display::Nanoseconds(static_cast<int64_t>(time_ns))},
                  counts);
  }
  void update() { proof.update(turns, panel); }
  void finish(uint64_t time_ns) {
    turns.finish(display::Nanoseconds(static_cast<int64_t>(time_ns)), counts);
    update();
  }
  [[nodiscard]] const ProofEntry& last() const { return entries.back(); }
};

TEST_F(Proof, AnItemGetsAnEntryAtItsStartAndAtItsEnd) {
  account(1, "a.lts");
  account(2, "b.lts");
  flip(1, 0, 1000);
  update();
  ASSERT_EQ(entries.size(), 1u);
  EXPECT_EQ(last().event, Event::Started);
  EXPECT_EQ(last().item, "a.lts");
  EXPECT_EQ(last().panel, "LGD");
  EXPECT_EQ(last().process_start, 3u);
  EXPECT_EQ(last().frames, 0u);
  EXPECT_THAT(hashed, testing::ElementsAre("a.lts"));
  flip(1, 1, 2000);
  hash = "sha256:1";
  flip(2, 0, 3000);
  update();
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[1].event, Event::Ended);
  EXPECT_EQ(entries[1].turn, 1u);
  EXPECT_EQ(entries[1].frames, 2u);
  EXPECT_EQ(entries[1].whole, 1u);
  EXPECT_EQ(entries[1].from_us, 2);
  EXPECT_EQ(entries[1].until_us, 4);
  EXPECT_EQ(entries[1].exactness, "yes");
  EXPECT_EQ(entries[1].hash, "sha256:1");
  EXPECT_EQ(entries[2].event, Event::Started);
  EXPECT_EQ(entries[2].turn, 2u);
}

TEST_F(Proof, EachEntryHasTheSoundSinceTheOneBefore) {
  account(1, "a.mkv").sound = {.heard_ms = 5, .device = "plughw:0,3"};
  account(2, "b.lts");
  flip(1, 0, 1000);
  update();
  accounts[1].sound = {.heard_ms = 1200, .silent_ms = 300, .device = "plughw:0,3"};
  flip(1, 1, 11 * kMinuteNs);
  update();
  EXPECT_EQ(last().event, Event::Continues);
  EXPECT_EQ(last().heard_ms, 1200u);
  EXPECT_EQ(last().silent_ms, 300u);
  accounts[1].sound = {.heard_ms = 1200, .silent_ms = 800};
  flip(2, 0, 12 * kMinuteNs);
  update();
  ASSERT_EQ(entries.size(), 4u);
  EXPECT_EQ(entries[2].event, Event::Ended);
  EXPECT_EQ(entries[2].heard_ms, 0u);
  EXPECT_EQ(entries[2].silent_ms, 500u);
  EXPECT_EQ(entries[2].sound_device, "plughw:0,3") << "the last one that was heard";
  finish(13 * kMinuteNs);
  EXPECT_EQ(last().heard_ms + last().silent_ms, 0u);
  EXPECT_EQ(last().sound_device, "");
}

TEST_F(Proof, TheEntryOfATurnThatEndsHasTheOverlaysThatItsFramesHad) {
  account(1, "a.lts");
  account(2, "b.lts");
  flip(1, 0, 1000);
  update();
  accounts[1].overlays = {"picture logo.png, top", "text Closed, middle"};
  flip(2, 0, 2000);
  update();
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[1].overlays, "picture logo.png, top; text Closed, middle");
  EXPECT_EQ(entries[2].overlays, "");
}

TEST_F(Proof, ManyShortTurnsBetweenTwoCallsAreAllWritten) {
  for (uint64_t item = 1; item <= TurnLog::kKept; ++item) {
    account(item, "a");
    flip(item, 0, item * 1000);
  }
  update();
  EXPECT_EQ(entries.size(), 2 * TurnLog::kKept - 1);
  EXPECT_EQ(turns.lost(), 0u);
}

TEST_F(Proof, ALoopIsAPlayAndTheLastOneCountsAsInterruptedIfItIsNotOver) {
  account(1, "a").to_end = false;
  for (uint64_t frame = 0; frame < 8; ++frame) flip(1, frame % 3, 1000 + frame);
  finish(2000);
  EXPECT_EQ(last().whole, 2u);
  EXPECT_EQ(last().interrupted, 1u);
  EXPECT_EQ(last().frames, 8u);
}

TEST_F(Proof, AJumpInterruptsAnItemUnlessItsLastFrameIsDisplayed) {
  for (const uint64_t shown : {3u, 2u}) {
    account(shown, "a").handed_out = 3;
    for (uint64_t frame = 0; frame < shown; ++frame) flip(shown, frame, 1000 + frame, shown);
    finish(2000);
    EXPECT_EQ(last().whole, shown == 3 ? 1u : 0u);
    EXPECT_EQ(last().interrupted, shown == 3 ? 0u : 1u);
  }
}

TEST_F(Proof, APlayThatBeganInTheMiddleIsNotWhole) {
  account(1, "a").from_start = false;
  flip(1, 5, 1000);
  flip(1, 6, 1001);
  flip(1, 0, 1002);
  account(2, "b");
  flip(2, 0, 1003);
  update();
  EXPECT_EQ(entries[1].whole, 1u);
  EXPECT_EQ(entries[1].interrupted, 1u);
}

TEST_F(Proof, MissedVblanksAndDamageBelongToTheItemThatWasShown) {
  account(1, "a").damage = {.damaged = 2, .missing = 1};
  account(2, "b");
  flip(1, 0, 1000);
  update();
  counts.missed += 1;
  counts.repeated_underrun += 2;
  counts.dropped += 3;
  flip(2, 0, 2000);
  flip(2, 1, 3000);
  finish(4000);
  EXPECT_EQ(entries[1].missed, 6u);
  EXPECT_EQ(entries[1].damaged, 3u);
  EXPECT_EQ(last().missed, 0u);
  EXPECT_EQ(last().damaged, 0u);
}

TEST_F(Proof, FramesThatNoPanelDisplayedAreUnseenAndTheirPlayIsNotWhole) {
  account(1, "a");
  flip(1, 0, 1000);
  update();
  panel.away = true;
  flip(1, 1, 1001);
  update();
  panel.away = false;
  flip(1, 2, 1002);
  flip(1, 0, 1003);
  finish(2000);
  EXPECT_EQ(last().frames, 3u);
  EXPECT_EQ(last().unseen, 1u);
  EXPECT_EQ(last().interrupted, 1u);
  EXPECT_EQ(last().whole, 1u) << "the second play";
}

TEST_F(Proof, StatesTheWorstExactnessOfTheTurn) {
  account(1, "a");
  flip(1, 0, 1000);
  update();
  panel.exactness = "no";
  update();
  panel.exactness = "cannot tell";
  finish(2000);
  EXPECT_EQ(last().exactness, "no");
}

TEST_F(Proof, ALongTurnGetsAnEntryEveryTenMinutesWithTheCountsSinceTheLast) {
  account(1, "a");
  for (uint64_t minute = 0; minute <= 25; ++minute) {
    flip(1, minute % 2, 1 + minute * kMinuteNs);
    update();
  }
  finish(26 * kMinuteNs);
  ASSERT_EQ(entries.size(), 4u);
  EXPECT_EQ(entries[1].event, Event::Continues);
  EXPECT_EQ(entries[2].event, Event::Continues);
  EXPECT_EQ(entries[3].event, Event::Ended);
  uint64_t frames = 0, plays = 0;
  for (const ProofEntry& entry : entries) {
    EXPECT_EQ(entry.turn, 1u);
    frames += entry.frames;
    plays += entry.whole + entry.interrupted;
  }
  EXPECT_EQ(frames, 26u);
  EXPECT_EQ(plays, 13u);
  EXPECT_EQ(entries[2].from_us, entries[1].until_us);
}

/// Plays lists in simulated time.
class ProofOfLists : public Proof {
 protected:
  test::FakeShelf shelf;

  void put(const std::string& name, uint64_t frames) {
    shelf.put(name, {0, {.geometry = kItemSize, .frames = frames}});
  }
  void play_list(Playlist list, std::optional<uint64_t> vblanks = std::nullopt) {
    PlaylistSource source(std::make_shared<const Playlist>(std::move(list)),
                          {.panel = kItemSize, .open = shelf.opener()});
    source.open_first();
    const auto display =
        display::open_virtual_display({.geometry = kItemSize,
                                       .refresh = {60, 1},
                                       .clock = std::make_shared<display::SimulatedClock>()});
    PlaybackOptions options{
        .vblanks = vblanks, .filling = Filling::InPresenter, .source_name = "list"};
    options.turns = &turns;
    (void)play(*display, source, options);
    for (uint32_t item = 1; item < 100; ++item)
      if (const auto known = source.account_of(item)) accounts[item] = *known;
    update();
  }
  /// Returns "NAME frames whole interrupted" of each turn that ended.
  [[nodiscard]] std::vector<std::string> turns_of_entries() const {
    std::vector<std::string> texts;
    for (const ProofEntry& entry : entries)
      if (entry.event == Event::Ended)
        texts.push_back(entry.item + " " + std::to_string(entry.frames) + " " +
                        std::to_string(entry.whole) + " " + std::to_string(entry.interrupted));
    return texts;
  }
};

TEST_F(ProofOfLists, EachFrameOfEachItemIsCountedOnce) {
  put("a", 3);
  put("b", 5);
  put("still", 1);
  Playlist list = list_of({"a", "b", "still"}, 2);
  list.items[1].loops = 2;
  list.items[2].still_s = 1.0;
  play_list(std::move(list));
  EXPECT_THAT(turns_of_entries(), testing::ElementsAre("a 3 1 0", "b 10 2 0", "still 4 1 0",
                                                       "a 3 1 0", "b 10 2 0", "still 4 1 0"));
}

TEST_F(ProofOfLists, TheEndOfTheRequestedTimeInterruptsTheItem) {
  put("a", 30);
  play_list(list_of({"a", "a"}), 40);
  EXPECT_THAT(turns_of_entries(), testing::ElementsAre("a 30 1 0", "a 10 0 1"));
}

TEST_F(ProofOfLists, ABrokenItemIsInterrupted) {
  shelf.put("breaks", {0, {.geometry = kItemSize, .frames = 5, .fails_after = 2}});
  put("b", 2);
  play_list(list_of({"missing", "breaks", "b"}));
  EXPECT_THAT(turns_of_entries(), testing::ElementsAre("breaks 2 0 1", "b 2 1 0"));
}

TEST_F(ProofOfLists, AnItemPerVblankDelaysNoReportToTheServiceManager) {
  put("a", 1);
  put("b", 1);
  PlaylistSource source(std::make_shared<const Playlist>(list_of({"a", "b"}, kForever)),
                        {.panel = kItemSize, .open = shelf.opener()});
  source.open_first();
  const auto display = display::open_virtual_display({.geometry = kItemSize, .refresh = {60, 1}});
  int reports = 0;
  PlaybackOptions options{.vblanks = 100, .source_name = "list"};
  options.turns = &turns;
  options.on_turn = [&] { update(); };
  options.on_report = [&](const PlayReport& /*report*/) { ++reports; };
  const PlayResult result = play(*display, source, options);
  update();
  EXPECT_GE(reports, 1);
  uint64_t frames = 0;
  for (const ProofEntry& entry : entries) frames += entry.frames;
  EXPECT_EQ(frames, result.report.pace.shown);
}

}  // namespace
}  // namespace lenticule::player
