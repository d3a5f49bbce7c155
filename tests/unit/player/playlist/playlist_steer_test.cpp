// SPDX-License-Identifier: Apache-2.0
// Tests pausing and jumping while playing, with real threads and a real clock. No assertion depends
// on the machine's speed.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <future>
#include <map>
#include <thread>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
#include "tests/support/comes_true.h"
#include "tests/unit/player/playlist/fake_items.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using test::kItemSize;
using test::list_of;

constexpr auto kTimeout = std::chrono::seconds(30);

class PlaylistSteer : public testing::Test {
 protected:
  test::FakeShelf shelf;
  ItemOpener open = shelf.opener();
  std::atomic<uint64_t> rounds{1};  ///< rounds that the sound of an item was told
  std::shared_ptr<test::RememberingRecorder> recorder =
      std::make_shared<test::RememberingRecorder>();
  PlaybackControl control;
  WakeFd stop;
  std::unique_ptr<PlaylistSource> source;
  std::unique_ptr<display::Display> display;
  std::thread player;
  PlayResult result;

  void start(Playlist list) {
    source = std::make_unique<PlaylistSource>(
        std::make_shared<const Playlist>(std::move(list)),
        PlaylistSourceOptions{
            .panel = kItemSize, .open = open, .left_item = [this](uint32_t number) {
              return control.left_item(number);
            }});
    source->open_first();
    display = display::open_virtual_display(
        {.geometry = kItemSize, .refresh = {200, 1}, .recorder = recorder});
    player = std::thread([this] {
      result = play(*display, *source,
                    {.stall_timeout = std::nullopt, .control = &control, .stop_fd = stop.fd()});
    });
  }
  void TearDown() override {
    stop.signal();
    if (player.joinable()) player.join();
    const PaceCounts& pace = result.report.pace;
    EXPECT_EQ(pace.vblanks, pace.shown + pace.repeated_planned + pace.repeated_underrun +
                                pace.missed + pace.held);
  }
  [[nodiscard]] bool plays(const std::string& name, uint64_t number) const {
    const DisplayedPlace place = control.displayed();
    const auto item = source->account_of(static_cast<uint32_t>(place.item));
    return item && item->source.text == name && place.number == number;
  }
  [[nodiscard]] bool is_moving() const {
    const uint64_t before = control.displayed().frames;
    return test::comes_true([&] { return control.displayed().frames > before; });
  }
  /// Returns an empty text, or the reason why the old place stays.
  [[nodiscard]] std::string jump(Jump where) const {
    where.displayed = source->account_of(static_cast<uint32_t>(control.displayed().item));
    return outcome_of([&](const JumpDone& done) { source->jump(where, done); });
  }
  /// Calls one of the source's functions that end with a JumpDone, and returns as jump() does.
  [[nodiscard]] static std::string outcome_of(const std::function<void(const JumpDone&)>& call) {
    std::promise<std::string> promise;
    call([&](const Error* error) { promise.set_value(error ? error->what() : ""); });
    auto done = promise.get_future();
    return done.wait_for(kTimeout) == std::future_status::ready ? done.get() : "no answer";
  }
  [[nodiscard]] std::string cue(const Jump& where) const {
    return outcome_of([&](const JumpDone& done) { source->cue(where, done); });
  }
  [[nodiscard]] std::string go() const {
    return outcome_of([&](const JumpDone& done) { source->go(done); });
  }
  [[nodiscard]] std::string back() const {
    return outcome_of([&](const JumpDone& done) { source->return_now(done); });
  }
  /// Returns the numbers of the shelf's frames that were displayed, by their pixels, in order.
  [[nodiscard]] std::vector<uint64_t> displayed_frames(uint64_t most) const {
    std::map<uint64_t, uint64_t> numbers;
    for (uint64_t k = 0; k < most; ++k)
      numbers[test::checksum_of(test::numbered_frame(kItemSize, k).view())] = k;
    std::vector<uint64_t> frames;
    for (const test::DisplayedFrame& frame : recorder->shown())
      frames.push_back(numbers.at(frame.checksum));
    return frames;
  }
  /// Returns true if the last displayed frame of the shelf is one of these.
  [[nodiscard]] bool displays(uint64_t first, uint64_t last) const {
    const std::vector<uint64_t> frames = displayed_frames(600);
    return !frames.empty() && frames.back() >= first && frames.back() <= last;
  }
  void pause_still() {
    control.pause(true);
    // A pending flip completes within a few polls.
    uint64_t frames = 0;
    do {
      frames = control.displayed().frames;
      std::this_thread::sleep_for(milliseconds(60));
    } while (control.displayed().frames != frames);
  }
  [[nodiscard]] std::shared_ptr<const Playlist> other(const std::string& name) const {
    return std::make_shared<const Playlist>(playlist_of(parse_source(name), kForever));
  }
};

TEST_F(PlaylistSteer, APauseHoldsThePictureAndPlayingContinuesWithTheNextFrame) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 1000}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  pause_still();
  const DisplayedPlace paused = control.displayed();
  std::this_thread::sleep_for(milliseconds(100));
  EXPECT_EQ(control.displayed().frames, paused.frames);
  const size_t before = recorder->shown().size();
  control.pause(false);
  ASSERT_TRUE(is_moving());
  ASSERT_TRUE(test::comes_true([&] { return recorder->shown().size() > before + 2; }));
  const auto shown = recorder->shown();
  for (size_t k = 1; k < shown.size(); ++k) EXPECT_EQ(shown[k].id, shown[k - 1].id + 1);
}

TEST_F(PlaylistSteer, ASeekWhilePausedShowsExactlyThatFrame) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 1000}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  pause_still();
  for (const uint64_t frame : {500u, 7u, 0u, 999u}) {
    ASSERT_EQ(jump({.frame = frame}), "");
    ASSERT_TRUE(test::comes_true([&] { return plays("a", frame); })) << frame;
    std::this_thread::sleep_for(milliseconds(20));
    EXPECT_TRUE(plays("a", frame)) << "one frame, and no more";
    frames::WovenFrame copy(kItemSize);
    ASSERT_TRUE(control.copy_shown(copy));
    EXPECT_EQ(copy, test::numbered_frame(kItemSize, frame));
  }
  EXPECT_EQ(jump({.frame = 1000}), "frame 1000: a has the frames 0 to 999");
  EXPECT_TRUE(plays("a", 999));
}

TEST_F(PlaylistSteer, ASeekBeyondTheEndNamesTheFramesAlsoIfOnlyTheEndTellsTheirNumber) {
  shelf.put("a", {.script = {.geometry = kItemSize, .frames = 48}, .count_at_end = true});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(jump({.frame = 48}), "frame 48: a has the frames 0 to 47");
  EXPECT_TRUE(is_moving());
}

TEST_F(PlaylistSteer, TheLastProblemEndsWhenItsItemPlaysWhole) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 10}});
  start(list_of({"a", "b"}, kForever));
  ASSERT_TRUE(test::comes_true([&] { return source->status().last_problem.starts_with("b: "); }));
  shelf.put("b", {500, {.geometry = kItemSize, .frames = 10}});
  EXPECT_TRUE(test::comes_true([&] { return source->status().last_problem.empty(); }));
}

TEST_F(PlaylistSteer, AJumpDiscardsFramesFilledBefore) {
  shelf.put("slow", {0, {.geometry = kItemSize, .frames = 100, .rate = frames::Rate{1, 2}}});
  shelf.put("b", {500, {.geometry = kItemSize, .frames = 50}});
  start(playlist_of(parse_source("slow"), kForever));
  ASSERT_TRUE(test::comes_true([&] { return plays("slow", 0); }));
  ASSERT_EQ(jump({.list = other("b")}), "");
  ASSERT_TRUE(test::comes_true([&] { return control.displayed().frames > 1; }));
  ASSERT_TRUE(test::comes_true([&] { return recorder->shown().size() > 1; }));
  EXPECT_EQ(recorder->shown()[1].checksum,
            test::checksum_of(test::numbered_frame(kItemSize, 500).view()))
      << "the slow one's frames 1 and 2 were in the scan-out buffers";
}

TEST_F(PlaylistSteer, AFailedOpenLeavesTheOldItemPlaying) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 10}});
  shelf.put("large", {0, {.geometry = {.width = 32, .height = 8}, .frames = 10}});
  shelf.put("breaks", {0, {.geometry = kItemSize, .frames = 10, .fails_after = 0}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(jump({.list = other("missing")}), "missing: no such file");
  EXPECT_NE(jump({.list = other("large")}).find("32x8"), std::string::npos);
  EXPECT_EQ(jump({.list = other("breaks")}), "breaks: the fake source broke");
  EXPECT_TRUE(is_moving());
  EXPECT_EQ(source->status().source, "a");
}

TEST_F(PlaylistSteer, NextAndPreviousWrapAroundTheList) {
  for (const char* name : {"a", "b", "c"})
    shelf.put(name, {0, {.geometry = kItemSize, .frames = 100'0}});
  Playlist list = list_of({"a", "b", "c"}, kForever);
  for (PlaylistItem& item : list.items) item.loops = kForever;
  start(list);
  ASSERT_TRUE(is_moving());
  for (const char* name : {"b", "c", "a"}) {
    ASSERT_EQ(jump({.item = 1, .relative = true}), "");
    EXPECT_EQ(source->status().source, name);
  }
  ASSERT_EQ(jump({.item = -1, .relative = true}), "");
  EXPECT_EQ(source->status().source, "c");
  ASSERT_EQ(jump({.item = 1}), "");
  EXPECT_EQ(source->status().source, "b");
  EXPECT_EQ(jump({.item = 3}), "item 3: the list has 3 items");
}

TEST_F(PlaylistSteer, NextInTheLastSecondsOfAPictureShowsTheItemAfterIt) {
  shelf.put("still", {0, {.geometry = kItemSize, .frames = 1, .rate = frames::Rate{1, 2}}});
  shelf.put("b", {100, {.geometry = kItemSize, .frames = 1000}});
  shelf.put("c", {100, {.geometry = kItemSize, .frames = 1000}});
  Playlist list = list_of({"still", "b", "c"}, kForever);
  list.items[0].still_s = 2.0;
  start(list);
  ASSERT_TRUE(is_moving());
  ASSERT_TRUE(test::comes_true([&] { return source->status().source == "b"; }));
  ASSERT_TRUE(plays("still", 0)) << "b is read ahead";
  ASSERT_EQ(jump({.item = 1, .relative = true}), "");
  EXPECT_EQ(source->status().source, "b");
  ASSERT_EQ(jump({.item = 1, .relative = true}), "");
  EXPECT_EQ(source->status().source, "c") << "also if b is not displayed yet";
}

TEST_F(PlaylistSteer, TheRoundsOfAListThatHasEndedAreDone) {
  for (const char* name : {"a", "b"}) shelf.put(name, {0, {.geometry = kItemSize, .frames = 3}});
  start(list_of({"a", "b"}));
  player.join();
  EXPECT_EQ(source->status().rounds_done, 1);
}

TEST_F(PlaylistSteer, ARingIsOpenedOnceHoweverManyTurnsItHas) {
  shelf.put("ring:/s", {0, {.geometry = kItemSize, .frames = 5000, .rate = frames::Rate{60, 1}}});
  Playlist list = list_of({"ring:/s", "missing", "ring:/s"}, kForever);
  for (PlaylistItem& item : list.items) item.duration_s = 0.05;
  start(list);
  EXPECT_TRUE(test::comes_true([&] { return source->status().rounds_done >= 3; }));
  const std::vector<uint64_t> frames = displayed_frames(2000);
  for (size_t k = 1; k < frames.size(); ++k) ASSERT_EQ(frames[k], frames[k - 1] + 1);
}

TEST_F(PlaylistSteer, ARingWithoutARendererIsWaitedFor) {
  shelf.put("ring:/s", {.waits = true});
  start(list_of({"ring:/s"}));
  EXPECT_TRUE(test::comes_true([&] { return source->status().state == kNoRenderer; }));
  EXPECT_EQ(kNoRenderer.word, "waiting");
}

TEST_F(PlaylistSteer, TheStateOfABlankPanelIsBlankUntilBack) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 400}});
  shelf.put("black", {500, {.geometry = kItemSize, .frames = 1}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(source->status().state, PlayState());
  ASSERT_EQ(jump({.list = other("black"), .item = 0, .interrupts = true}), "");
  EXPECT_EQ(source->status().state, (PlayState{"blank", "until 'back'"}));
  ASSERT_EQ(back(), "");
  EXPECT_EQ(source->status().state, PlayState());
}

TEST_F(PlaylistSteer, NextAndPreviousPassItemsThatCannotBePlayed) {
  for (const char* name : {"a", "d"}) shelf.put(name, {0, {.geometry = kItemSize, .frames = 100}});
  shelf.put("breaks", {0, {.geometry = kItemSize, .frames = 10, .fails_after = 0}});
  Playlist list = list_of({"a", "missing", "breaks", "d"}, kForever);
  for (PlaylistItem& item : list.items) item.loops = kForever;
  start(list);
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(jump({.item = 1, .relative = true}), "");
  EXPECT_EQ(source->status().source, "d");
  EXPECT_EQ(source->status().last_problem, "breaks: the fake source broke");
  EXPECT_EQ(jump({.item = -1, .relative = true}), "");
  EXPECT_EQ(source->status().source, "a");
  EXPECT_TRUE(source->status().last_problem.starts_with("missing: no such file"));
  EXPECT_EQ(jump({.item = 1}), "missing: no such file") << "an item that was asked for by number";
  EXPECT_EQ(source->status().source, "a");
}

TEST_F(PlaylistSteer, NextFailsIfNoOtherItemCanBePlayed) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 100}});
  Playlist list = list_of({"a", "b", "c"}, kForever);
  list.items[0].loops = kForever;
  start(list);
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(jump({.item = 1, .relative = true}), "c: no such file");
  EXPECT_TRUE(is_moving());
  EXPECT_EQ(source->status().source, "a");
}

TEST_F(PlaylistSteer, AnItemThatPlaysIsNotWaitedForHoweverOftenTheOthersAreTried) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 1000}});
  start(list_of({"a", "b", "c"}, kForever));
  const auto next_is_open = [&](int attempts) {
    return test::comes_true([&] { return shelf.opened() >= attempts; });
  };
  int attempts = 4;  // a, and the three of the next round
  for (int n = 0; n < 3; ++n, attempts += 5) {
    ASSERT_TRUE(next_is_open(attempts));
    EXPECT_TRUE(source->status().state.plays()) << source->status().state.reason;
    EXPECT_EQ(jump({.item = 1, .relative = true}), "c: no such file");
  }
  ASSERT_TRUE(next_is_open(attempts));
  EXPECT_TRUE(source->status().state.plays()) << source->status().state.reason;
  EXPECT_EQ(source->status().skipped, 2u) << "each is one item, however often it is tried";
}

TEST_F(PlaylistSteer, TheLastOfManyJumpsCounts) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 1000}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  pause_still();
  std::atomic<int> answers{0};
  constexpr int kJumps = 200;
  for (uint64_t frame = 0; frame < kJumps; ++frame)
    source->jump({.frame = frame}, [&](const Error*) { ++answers; });
  ASSERT_TRUE(test::comes_true([&] { return answers.load() == kJumps; }));
  EXPECT_TRUE(test::comes_true([&] { return plays("a", kJumps - 1); }));
}

TEST_F(PlaylistSteer, TheNumberOfLoopsCanBeReduced) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 10}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  source->set_loops(1);
  player.join();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.pace.shown % 10, 0u) << "to the end of a round";
}

TEST_F(PlaylistSteer, TheSoundOfAnItemFollowsItsNumberOfLoops) {
  open = [this, opener = shelf.opener()](const PlaylistItem& item, uint64_t first_frame) {
    OpenedSource opened = opener(item, first_frame);
    opened.begin_sound = [this](uint64_t, uint64_t wanted) { rounds = wanted; };
    return opened;
  };
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 10}});
  start(playlist_of(parse_source("a"), 1'000'000));
  ASSERT_TRUE(test::comes_true([&] { return rounds == 1'000'000; }));
  source->set_loops(kForever);
  EXPECT_TRUE(test::comes_true([&] { return rounds == kForever; }));
}

TEST_F(PlaylistSteer, AnInterruptionReturnsToTheDisplayedFrame) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 400}});
  shelf.put("alarm", {500, {.geometry = kItemSize, .frames = 7}});
  start(playlist_of(parse_source("a"), kForever));
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(is_moving());
    const size_t before = recorder->shown().size();
    auto alarm = std::make_shared<const Playlist>(playlist_of(parse_source("alarm"), 1));
    ASSERT_EQ(jump({.list = alarm, .item = 0, .interrupts = true}), "");
    ASSERT_TRUE(test::comes_true([&] { return recorder->shown().size() > before + 20; }));
    ASSERT_TRUE(test::comes_true([&] { return source->status().source == "a"; }));
  }
  EXPECT_EQ(source->status().interrupted, "");
  EXPECT_EQ(source->status().item, 0u);
  const std::vector<uint64_t> frames = displayed_frames(600);
  int interruptions = 0;
  for (size_t at = 1; at + 7 < frames.size(); ++at) {
    if (frames[at] != 500) continue;
    ++interruptions;
    for (uint64_t k = 0; k < 7; ++k) EXPECT_EQ(frames[at + k], 500 + k);
    EXPECT_EQ(frames[at + 7], frames[at - 1]) << "where it was";
  }
  EXPECT_EQ(interruptions, 3);
}

TEST_F(PlaylistSteer, AnInterruptedItemKeepsItsPlaceInTheListAndItsLoops) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 50}});
  shelf.put("b", {100, {.geometry = kItemSize, .frames = 30}});
  shelf.put("alarm", {500, {.geometry = kItemSize, .frames = 5}});
  Playlist list = list_of({"a", "b"}, 1);
  list.items[0].loops = 2;
  start(list);
  ASSERT_TRUE(is_moving());
  auto alarm = std::make_shared<const Playlist>(playlist_of(parse_source("alarm"), 1));
  ASSERT_EQ(jump({.list = alarm, .item = 0, .interrupts = true}), "");
  player.join();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  // Without the interruption and the frame that was shown again, the list is complete.
  std::vector<uint64_t> frames = displayed_frames(600);
  const auto at = std::find(frames.begin(), frames.end(), 500u);
  ASSERT_NE(at, frames.end());
  frames.erase(at, at + 6);
  std::vector<uint64_t> expected;
  for (uint64_t k = 0; k < 100; ++k) expected.push_back(k % 50);
  for (uint64_t k = 0; k < 30; ++k) expected.push_back(100 + k);
  EXPECT_EQ(frames, expected);
}

TEST_F(PlaylistSteer, BackEndsAnInterruptionAtOnceAndASecondOneKeepsThePlace) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 400}});
  shelf.put("long", {500, {.geometry = kItemSize, .frames = 90}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(back(), "back: nothing is interrupted");
  for (int k = 0; k < 2; ++k) {
    ASSERT_EQ(jump({.list = other("long"), .item = 0, .interrupts = true}), "");
    ASSERT_TRUE(test::comes_true([&] { return displays(503, 599); }));
    EXPECT_EQ(source->status().interrupted, "a");
    EXPECT_EQ(source->list()->name, "a") << "the list that continues";
    EXPECT_FALSE(source->status().item) << "what interrupts is not in the list";
  }
  ASSERT_EQ(back(), "");
  EXPECT_EQ(source->status().source, "a");
  ASSERT_TRUE(test::comes_true([&] { return displays(0, 399); }));
  const std::vector<uint64_t> frames = displayed_frames(600);
  const auto interrupted = std::find(frames.begin(), frames.end(), 500u);
  const auto continues =
      std::find_if(interrupted, frames.end(), [](uint64_t frame) { return frame < 400; });
  EXPECT_EQ(*continues, *(interrupted - 1));
}

TEST_F(PlaylistSteer, BackIsAnsweredWhileTheOutputIsOffAndShowsNoInterruption) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 400}});
  shelf.put("long", {500, {.geometry = kItemSize, .frames = 90}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  ASSERT_TRUE(control.switch_output(false, kTimeout));
  ASSERT_EQ(jump({.list = other("long"), .item = 0, .interrupts = true}), "");
  EXPECT_TRUE(plays("a", control.displayed().number)) << "nothing is displayed meanwhile";
  ASSERT_EQ(back(), "");
  EXPECT_EQ(source->status().source, "a");
  EXPECT_EQ(source->status().interrupted, "");
  ASSERT_TRUE(control.switch_output(true, kTimeout));
  ASSERT_TRUE(is_moving());
  const std::vector<uint64_t> frames = displayed_frames(600);
  EXPECT_EQ(std::ranges::count_if(frames, [](uint64_t frame) { return frame >= 500; }), 0);
}

TEST_F(PlaylistSteer, FramesOfBeforeAJumpAreNotShownOnceItIsAnswered) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 400}});
  shelf.put("b", {500, {.geometry = kItemSize, .frames = 90}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  ASSERT_TRUE(control.switch_output(false, kTimeout));
  ASSERT_EQ(outcome_of([&](const JumpDone& done) {
              source->jump({.list = other("b")}, [this, done](const Error* error) {
                const size_t before = recorder->shown().size();
                // The presenter runs on, and has frames of a, while the answer is on its way.
                EXPECT_TRUE(control.switch_output(true, kTimeout));
                std::this_thread::sleep_for(milliseconds(50));
                // A frame that was on its way when the output went off may be sent again.
                EXPECT_LE(recorder->shown().size(), before + 1);
                done(error);
              });
            }),
            "");
  ASSERT_TRUE(test::comes_true([&] { return displays(500, 589); }));
}

TEST_F(PlaylistSteer, NextDuringAnInterruptionGoesToTheNextItemOfTheList) {
  for (const char* name : {"a", "b", "long"})
    shelf.put(name, {0, {.geometry = kItemSize, .frames = 400}});
  start(list_of({"a", "b"}, kForever));
  ASSERT_TRUE(is_moving());
  ASSERT_EQ(jump({.list = other("long"), .item = 0, .interrupts = true}), "");
  ASSERT_EQ(jump({.item = 1, .relative = true}), "");
  EXPECT_EQ(source->status().source, "b");
  EXPECT_EQ(source->status().interrupted, "");
}

TEST_F(PlaylistSteer, ACuedItemIsDecodedOnceAndShownByGo) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 400}});
  shelf.put("b", {500, {.geometry = kItemSize, .frames = 50}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(go(), "go: no item is cued");
  EXPECT_EQ(cue({.list = other("missing")}), "missing: no such file");
  ASSERT_EQ(cue({.list = other("b"), .item = 0}), "");
  EXPECT_EQ(source->status().cued, "b");
  const int opened = shelf.opened();
  ASSERT_TRUE(is_moving());
  EXPECT_EQ(source->status().source, "a");
  ASSERT_EQ(go(), "");
  ASSERT_TRUE(test::comes_true([&] { return displays(500, 599); }));
  EXPECT_EQ(shelf.opened(), opened);
  EXPECT_EQ(source->status().cued, "");
  EXPECT_EQ(go(), "go: no item is cued");
}

TEST_F(PlaylistSteer, AListDoesNotEndWhileAnItemIsCued) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 40}});
  shelf.put("b", {500, {.geometry = kItemSize, .frames = 5}});
  start(playlist_of(parse_source("a"), 1));
  auto last = std::make_shared<const Playlist>(playlist_of(parse_source("b"), 1));
  ASSERT_EQ(cue({.list = last, .item = 0}), "");
  ASSERT_TRUE(test::comes_true([&] { return plays("a", 39); }));
  std::this_thread::sleep_for(milliseconds(50));
  EXPECT_TRUE(plays("a", 39)) << "the last frame stays";
  EXPECT_EQ(source->status().state, (PlayState{"cued", "b waits for 'go'"}));
  ASSERT_EQ(go(), "");
  player.join();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_TRUE(displays(504, 504));
}

}  // namespace
}  // namespace lenticule::player
