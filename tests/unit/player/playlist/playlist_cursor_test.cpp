// SPDX-License-Identifier: Apache-2.0
// Tests the place in a playlist: jumps, and lists that are replaced while an item plays.
#include <gtest/gtest.h>

#include "base/error.h"
#include "player/playlist/item_loader.h"
#include "tests/unit/player/playlist/fake_items.h"

namespace lenticule::player {
namespace {

constexpr LocalTime kNow{0, 0};

std::shared_ptr<const Playlist> list(const std::vector<std::string>& names) {
  return std::make_shared<const Playlist>(test::list_of(names, kForever));
}

class PlaylistCursorTest : public testing::Test {
 protected:
  PlaylistCursor cursor{list({"a", "b", "c"})};
  PlaylistItem playing;

  void play(size_t index) {
    cursor.choose(index, 0);
    cursor.begin(index, 0);
    playing = cursor.list()->items[index];
  }
  [[nodiscard]] std::string next() const {
    const NextItem pick = cursor.next(kNow);
    return cursor.list()->items.at(pick.index).source.text;
  }
};

TEST_F(PlaylistCursorTest, AnItemOfTheNewListContinuesAtItsNewPlace) {
  play(1);
  EXPECT_TRUE(cursor.replace_list(list({"x", "y", "b", "z"}), &playing));
  EXPECT_EQ(cursor.playing(), 2u);
  EXPECT_EQ(next(), "z");
}

TEST_F(PlaylistCursorTest, TheLastItemCompletesNoRoundIfItIsPlayedBeforeTheFirst) {
  auto once = std::make_shared<Playlist>(test::list_of({"a", "b", "c"}, 1));
  cursor = PlaylistCursor(once);
  play(0);
  const PlaylistPlace back = cursor.target_of({.item = -1, .relative = true});
  EXPECT_EQ(back.index, 2u);
  cursor.jump(back);
  cursor.begin(back.index, back.rounds_done);
  const NextItem after = cursor.next(kNow);
  EXPECT_EQ(after.kind, NextItem::Kind::Item);
  EXPECT_EQ(after.index, 0u);
  EXPECT_EQ(after.rounds_done, 0) << "the whole round is still to come";
}

TEST_F(PlaylistCursorTest, OfEqualItemsTheOneAtTheSamePlaceContinues) {
  play(1);
  EXPECT_TRUE(cursor.replace_list(list({"b", "b", "z"}), &playing));
  EXPECT_EQ(cursor.playing(), 1u);
}

TEST_F(PlaylistCursorTest, OfEqualItemsTheNearestContinuesInALongerList) {
  play(2);
  EXPECT_TRUE(cursor.replace_list(list({"c", "new", "b", "c", "z"}), &playing));
  EXPECT_EQ(next(), "z");
}

TEST_F(PlaylistCursorTest, AnItemWithChangedSettingsIsPlayedAgain) {
  play(1);
  auto changed = std::make_shared<Playlist>(*list({"x", "b", "z"}));
  changed->items[1].loops = 7;
  EXPECT_FALSE(cursor.replace_list(changed, &playing));
  EXPECT_EQ(next(), "b");
  auto first = std::make_shared<Playlist>(*list({"b", "z"}));
  first->items[0].loops = 7;
  EXPECT_FALSE(cursor.replace_list(first, &playing));
  EXPECT_EQ(next(), "b");
}

TEST_F(PlaylistCursorTest, AShorterListIsFollowedFromItsFirstItemIfNothingPlays) {
  cursor.choose(2, 0);
  EXPECT_FALSE(cursor.replace_list(list({"x", "y"}), nullptr));
  EXPECT_EQ(next(), "x");
}

TEST_F(PlaylistCursorTest, NextAndPreviousCountFromTheDisplayedItem) {
  play(2);
  ItemAccount shown{.number = 1, .source = cursor.list()->items[1].source, .index = 1};
  EXPECT_EQ(cursor.target_of({.item = 1, .relative = true, .displayed = shown}).index, 2u);
  EXPECT_EQ(cursor.target_of({.item = -1, .relative = true, .displayed = shown}).index, 0u);
  shown.source = parse_source("of another list");
  EXPECT_EQ(cursor.target_of({.item = 1, .relative = true, .displayed = shown}).index, 0u);
}

TEST_F(PlaylistCursorTest, AnItemThatWasChosenAheadAndClosedIsChosenAgain) {
  play(0);
  cursor.choose(1, 0);
  cursor.back_to_playing();
  EXPECT_EQ(next(), "b");
}

TEST_F(PlaylistCursorTest, AJumpCompletesNoRoundEvenIfTheNextOneWasChosenAhead) {
  play(2);
  cursor.choose(0, 1);
  EXPECT_EQ(cursor.target_of({.item = -1, .relative = true}).rounds_done, 0);
  EXPECT_EQ(cursor.target_of({.item = 0}).rounds_done, 0);
  cursor.back_to_playing();
  EXPECT_EQ(cursor.rounds_done(), 0);
  EXPECT_EQ(cursor.next(kNow).rounds_done, 1);
}

}  // namespace
}  // namespace lenticule::player
