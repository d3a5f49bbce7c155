// SPDX-License-Identifier: Apache-2.0
// Tests playlists in simulated time: every frame around every loop point at its vblank.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
#include "tests/support/comes_true.h"
#include "tests/unit/player/playlist/fake_items.h"

namespace lenticule::player {
namespace {

using test::DisplayedFrame;
using test::FakeItem;
using test::kItemSize;
using test::list_of;

class PlaylistPlay : public testing::Test {
 protected:
  test::FakeShelf shelf;
  std::shared_ptr<display::SimulatedClock> clock = std::make_shared<display::SimulatedClock>();
  std::shared_ptr<test::RememberingRecorder> recorder =
      std::make_shared<test::RememberingRecorder>();
  std::vector<PlaylistEvent> events;
  std::mutex events_mutex;
  LocalTime local{0, 0};
  std::optional<std::chrono::nanoseconds> longest_wait;
  PlaybackOptions options{.filling = Filling::InPresenter, .source_name = "list"};
  PlaylistStatus status;

  void put(const std::string& name, uint64_t base, uint64_t frames,
           std::optional<frames::Rate> rate = std::nullopt) {
    shelf.put(name, {base, {.geometry = kItemSize, .frames = frames, .rate = rate}});
  }

  PlayResult play_list(Playlist list) {
    PlaylistSource source(std::make_shared<const Playlist>(std::move(list)),
                          {.panel = kItemSize,
                           .open = shelf.opener(),
                           .local_time = [this] { return local; },
                           .on_event =
                               [this](const PlaylistEvent& event) {
                                 const std::lock_guard lock(events_mutex);
                                 events.push_back(event);
                               },
                           .longest_wait = longest_wait});
    source.open_first();
    const auto display = display::open_virtual_display(
        {.geometry = kItemSize, .refresh = {60, 1}, .clock = clock, .recorder = recorder});
    PlayResult result = play(*display, source, options);
    status = source.status();
    const PaceCounts& pace = result.report.pace;
    EXPECT_EQ(pace.vblanks, pace.shown + pace.repeated_planned + pace.repeated_underrun +
                                pace.missed + pace.held);
    return result;
  }
  [[nodiscard]] std::vector<std::string> details_of(PlaylistEvent::Kind kind) {
    const std::lock_guard lock(events_mutex);
    std::vector<std::string> details;
    for (const PlaylistEvent& event : events)
      if (event.kind == kind) details.push_back(event.detail);
    return details;
  }
  [[nodiscard]] static uint64_t checksum(uint64_t number) {
    return test::checksum_of(test::numbered_frame(kItemSize, number).view());
  }
  [[nodiscard]] std::vector<uint64_t> shown_numbers(uint64_t up_to) const {
    std::map<uint64_t, uint64_t> number_of;
    for (uint64_t n = 0; n < up_to; ++n) number_of[checksum(n)] = n;
    std::vector<uint64_t> numbers;
    for (const DisplayedFrame& displayed : recorder->shown())
      numbers.push_back(number_of.at(displayed.checksum));
    return numbers;
  }
};

TEST_F(PlaylistPlay, RepeatsAndLosesNoFrameAtTenThousandLoopPoints) {
  put("a", 0, 3);
  put("b", 10, 2);
  constexpr uint64_t kRounds = 5'000;
  const PlayResult result = play_list(list_of({"a", "b"}, kRounds));
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.pace.underruns, 0u);
  EXPECT_EQ(result.report.pace.missed, 0u);
  EXPECT_EQ(result.report.pace.held, 0u);
  const std::array<uint64_t, 5> sums = {checksum(0), checksum(1), checksum(2), checksum(10),
                                        checksum(11)};
  const std::vector<DisplayedFrame> shown = recorder->shown();
  ASSERT_EQ(shown.size(), 5 * kRounds);
  for (uint64_t k = 0; k < shown.size(); ++k)
    ASSERT_EQ(shown[k], (DisplayedFrame{1 + k, k, sums.at(k % 5)})) << "vblank " << k;
  EXPECT_EQ(status.started, 2 * kRounds);
}

TEST_F(PlaylistPlay, EveryItemHasItsOwnRate) {
  put("film", 0, 4, frames::Rate{24, 1});    // due at 0, 2, 5, 7; the next item begins at 10
  put("video", 10, 3, frames::Rate{60, 1});  // 10, 11, 12
  put("slow", 20, 2, frames::Rate{10, 1});   // 13, 19
  play_list(list_of({"film", "video", "slow"}));
  std::vector<uint64_t> vblanks;
  for (const DisplayedFrame& displayed : recorder->shown())
    vblanks.push_back(displayed.sequence - 1);
  EXPECT_THAT(vblanks, testing::ElementsAre(0, 2, 5, 7, 10, 11, 12, 13, 19));
  EXPECT_THAT(shown_numbers(32), testing::ElementsAre(0, 1, 2, 3, 10, 11, 12, 20, 21));
}

TEST_F(PlaylistPlay, LoopsAndDurationsCountFrames) {
  put("a", 0, 3);
  put("b", 10, 2, frames::Rate{30, 1});
  Playlist list = list_of({"a", "b"});
  list.items[0].loops = 2;
  list.items[1].duration_s = 0.1;  // three frames of 30
  play_list(list);
  EXPECT_THAT(shown_numbers(32), testing::ElementsAre(0, 1, 2, 0, 1, 2, 10, 11, 10));
}

TEST_F(PlaylistPlay, AStillPictureStaysForItsDuration) {
  put("still", 0, 1);
  put("b", 10, 1);
  Playlist list = list_of({"still", "b"});
  list.items[0].still_s = 1.0;
  const PlayResult result = play_list(list);
  EXPECT_THAT(shown_numbers(32), testing::ElementsAre(0, 0, 0, 0, 10)) << "four times a second";
  EXPECT_EQ(recorder->shown().back().sequence, 61u);
  EXPECT_EQ(result.report.pace.underruns, 0u);
}

TEST_F(PlaylistPlay, AFilmOfOneFrameIsNamedAndStaysAsAPictureDoes) {
  put("cut.lts", 0, 1);
  put("film.lts", 10, 2);
  put("picture.png", 20, 1);
  Playlist list = list_of({"cut.lts", "film.lts", "picture.png"});
  for (PlaylistItem& item : list.items) item.still_s = 0.5;
  play_list(list);
  EXPECT_THAT(shown_numbers(32), testing::ElementsAre(0, 0, 10, 11, 20, 20));
  EXPECT_THAT(details_of(PlaylistEvent::Kind::Still),
              testing::ElementsAre("it has only one frame"));
}

TEST_F(PlaylistPlay, BrokenItemsAreSkippedAndNamed) {
  put("a", 0, 2);
  put("b", 10, 2);
  shelf.put("breaks", {20, {.geometry = kItemSize, .frames = 5, .fails_after = 2}});
  shelf.put("large", {30, {.geometry = {.width = 32, .height = 8}, .frames = 2}});
  shelf.put("empty", {40, {.geometry = kItemSize, .frames = 0}});
  const PlayResult result = play_list(list_of({"missing", "a", "breaks", "large", "empty", "b"}));
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_THAT(shown_numbers(32), testing::ElementsAre(0, 1, 20, 21, 10, 11));
  EXPECT_EQ(status.skipped, 4u);
  std::vector<std::string> skipped;
  for (const PlaylistEvent& event : events)
    if (event.kind == PlaylistEvent::Kind::ItemSkipped) skipped.push_back(event.source);
  EXPECT_THAT(skipped, testing::UnorderedElementsAre("missing", "breaks", "large", "empty"));
}

TEST_F(PlaylistPlay, ABrokenItemIsReportedOnceInEachTurn) {
  const Playlist list = list_of({"a", "b"});
  int reports = 0;
  PlaylistReporter reporter(list, [&](const PlaylistEvent& event) {
    reports += event.kind == PlaylistEvent::Kind::ItemSkipped ? 1 : 0;
  });
  const PlaylistEvent skipped{
      .kind = PlaylistEvent::Kind::ItemSkipped, .source = "b", .detail = "b: is damaged"};
  reporter.report(skipped);
  reporter.report(skipped);
  EXPECT_EQ(reports, 1);
  reporter.started(
      {.list = std::make_shared<const Playlist>(list), .item = list.items[0], .index = 0});
  reporter.report(skipped);
  EXPECT_EQ(reports, 2);
  EXPECT_EQ(reporter.status().skipped, 1u);
}

TEST_F(PlaylistPlay, AListWithoutPlayableItemsEnds) {
  const PlayResult result = play_list(list_of({"missing", "gone"}));
  EXPECT_EQ(result.report.pace.shown, 0u);
  EXPECT_EQ(status.skipped, 2u);
}

TEST_F(PlaylistPlay, AListOfOneUnreadableItemIsAnError) {
  EXPECT_THROW((void)play_list(list_of({"missing"})), Error);
}

TEST_F(PlaylistPlay, StandsByUntilAnItemIsScheduled) {
  put("standby", 0, 2);
  put("day", 10, 2);
  Playlist list = list_of({"day"}, kForever);
  list.items[0].schedule = Schedule{.days = 0x7f, .from_minute = 600, .to_minute = 660};
  list.standby.emplace();
  list.standby->source = parse_source("standby");
  options.vblanks = 20;
  play_list(list);
  const std::vector<uint64_t> numbers = shown_numbers(32);
  ASSERT_EQ(numbers.size(), 20u);
  for (size_t k = 0; k < numbers.size(); ++k) EXPECT_EQ(numbers[k], k % 2) << "standby alone";
  local = {0, 605};
  recorder = std::make_shared<test::RememberingRecorder>();
  play_list(list);
  EXPECT_EQ(shown_numbers(32).front(), 10u);
}

TEST_F(PlaylistPlay, AMissingItemBeforeAGoodOneNeverLeadsToTheDefault) {
  put("standby", 0, 2);
  put("good", 10, 3);
  Playlist list = list_of({"missing", "good"}, kForever);
  list.standby.emplace().source = parse_source("standby");
  options.vblanks = 600;
  play_list(list);
  const std::vector<uint64_t> numbers = shown_numbers(32);
  const auto first = std::ranges::find(numbers, 10U);
  EXPECT_LT(first - numbers.begin(), 60);
  EXPECT_EQ(std::count_if(first, numbers.end(), [](uint64_t n) { return n < 10; }), 0);
  EXPECT_THAT(details_of(PlaylistEvent::Kind::Waiting), testing::IsEmpty());
}

TEST_F(PlaylistPlay, PlaysTheDefaultIfNoItemCanBePlayed) {
  put("standby", 0, 2);
  shelf.put("empty", {10, {.geometry = kItemSize, .frames = 0}});
  Playlist list = list_of({"missing", "empty"}, kForever);
  list.standby.emplace().source = parse_source("standby");
  options.vblanks = 40;
  EXPECT_EQ(play_list(list).outcome, PlayOutcome::Finished);
  const std::vector<uint64_t> numbers = shown_numbers(32);
  ASSERT_EQ(numbers.size(), 40u);
  for (size_t k = 0; k < numbers.size(); ++k) EXPECT_EQ(numbers[k], k % 2);
  EXPECT_EQ(status.state.word, "failed");
  EXPECT_EQ(status.state.reason,
            "none of 2 items can be played: missing: no such file; look for it");
  EXPECT_THAT(details_of(PlaylistEvent::Kind::Waiting), testing::ElementsAre(status.state.reason));
}

TEST_F(PlaylistPlay, AnItemThatBreaksAfterItsFirstFramesPlaysAgainInsteadOfTheDefault) {
  put("standby", 0, 2);
  shelf.put("breaks", {20, {.geometry = kItemSize, .frames = 5, .fails_after = 2}});
  Playlist list = list_of({"breaks"}, kForever);
  list.standby.emplace().source = parse_source("standby");
  options.vblanks = 20;
  play_list(list);
  EXPECT_THAT(shown_numbers(32), testing::Each(testing::Ge(20u)));
}

TEST_F(PlaylistPlay, IsBlackUntilAnItemIsScheduledAndSaysWhen) {
  put("black", 0, 1);
  put("day", 10, 2);
  Playlist list = list_of({"day"}, kForever);
  list.items[0].schedule = Schedule{.days = 0x7f, .from_minute = 540, .to_minute = 600};
  options.vblanks = 60;
  const PlayResult result = play_list(list);
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.pace.vblanks, 60u);
  EXPECT_EQ(recorder->shown().front().checksum, checksum(0));
  EXPECT_EQ(status.started, 0u) << "black is no item";
  EXPECT_EQ(status.state, (PlayState{"waiting", "no item is scheduled before Mon 09:00"}));
  EXPECT_THAT(details_of(PlaylistEvent::Kind::Waiting), testing::ElementsAre(status.state.reason));
}

TEST_F(PlaylistPlay, GrabbersThatCannotBePlayedHaveNoSignal) {
  put("black", 0, 1);
  longest_wait = std::chrono::milliseconds(50);
  (void)play_list(list_of({"v4l2:/dev/video0", "v4l2:/dev/video1"}, kForever));
  EXPECT_EQ(status.state.word, "no-signal");
  EXPECT_NE(status.state.reason.find("v4l2:/dev/video0: no such file"), std::string::npos);
}

TEST_F(PlaylistPlay, EndsAfterTheLongestWaitForAnItem) {
  put("black", 0, 1);
  longest_wait = std::chrono::milliseconds(50);
  EXPECT_EQ(play_list(list_of({"missing", "gone"}, kForever)).outcome, PlayOutcome::Finished);
  EXPECT_EQ(status.started, 0u);
  EXPECT_EQ(status.state.word, "failed");
  EXPECT_EQ(status.state.reason,
            "none of 2 items can be played: missing: no such file; look for it");
}

/// Stands for a film on a slow disk, whose index is at its end.
TEST_F(PlaylistPlay, AnItemThatIsOpenedSlowlyDoesNotInterruptThePresentOne) {
  constexpr uint64_t kFrames = 500;
  put("a", 0, kFrames);
  put("slow", kFrames, 1);
  std::promise<void> opened;
  std::promise<void> asked;
  PlaylistSource source(std::make_shared<const Playlist>(list_of({"a", "slow"})),
                        {.panel = kItemSize,
                         .open = [&, open = shelf.opener(), ready = opened.get_future().share()](
                                     const PlaylistItem& item, uint64_t frame) {
                           if (item.source.text == "slow") {
                             asked.set_value();
                             (void)ready.wait_for(std::chrono::seconds(60));
                           }
                           return open(item, frame);
                         }});
  source.set_display_rate({60, 1});
  source.open_first();
  frames::AcquiredFrame frame;
  uint64_t taken = 0;
  const auto take = [&] {
    const frames::PullStatus status = source.pull(frame);
    if (status != frames::PullStatus::Ready) return status;
    EXPECT_TRUE(
        std::ranges::equal(frame.frame.bytes, test::numbered_frame(kItemSize, taken++).bytes()));
    source.release(frame.token);
    return status;
  };
  ASSERT_TRUE(test::comes_true([&] { return take() == frames::PullStatus::Ready; }));
  asked.get_future().wait();
  while (taken < kFrames) ASSERT_EQ(take(), frames::PullStatus::Ready) << taken;
  // Its last frame stays.
  for (int n = 0; n < 100; ++n) EXPECT_EQ(take(), frames::PullStatus::NotYet);
  EXPECT_TRUE(source.waits_for_others());
  opened.set_value();
  ASSERT_TRUE(test::comes_true([&] { return take() == frames::PullStatus::Ready; }));
  EXPECT_EQ(taken, kFrames + 1);
}

}  // namespace
}  // namespace lenticule::player
