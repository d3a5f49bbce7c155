// SPDX-License-Identifier: Apache-2.0
// Tests pausing and jumping while playing, with real threads and a real clock. No assertion depends
// on the machine's speed.
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <thread>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
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
        PlaylistSourceOptions{.panel = kItemSize, .open = shelf.opener()});
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
  template <typename Condition>
  [[nodiscard]] static bool within_timeout(Condition condition) {
    const auto deadline = std::chrono::steady_clock::now() + kTimeout;
    while (!condition())
      if (std::chrono::steady_clock::now() > deadline)
        return false;
      else
        std::this_thread::sleep_for(milliseconds(1));
    return true;
  }
  [[nodiscard]] bool plays(const std::string& name, uint64_t number) const {
    const DisplayedPlace place = control.displayed();
    return source->source_of(static_cast<uint32_t>(place.item)) == name && place.number == number;
  }
  [[nodiscard]] bool is_moving() const {
    const uint64_t before = control.displayed().frames;
    return within_timeout([&] { return control.displayed().frames > before; });
  }
  /// Returns an empty text, or the reason why the old place stays.
  [[nodiscard]] std::string jump(Jump where) const {
    std::promise<std::string> promise;
    source->jump(std::move(where),
                 [&](const Error* error) { promise.set_value(error ? error->what() : ""); });
    auto done = promise.get_future();
    return done.wait_for(kTimeout) == std::future_status::ready ? done.get() : "no answer";
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
  ASSERT_TRUE(within_timeout([&] { return recorder->shown().size() > before + 2; }));
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
    ASSERT_TRUE(within_timeout([&] { return plays("a", frame); })) << frame;
    std::this_thread::sleep_for(milliseconds(20));
    EXPECT_TRUE(plays("a", frame)) << "one frame, and no more";
    frames::WovenFrame copy(kItemSize);
    ASSERT_TRUE(control.copy_shown(copy));
    EXPECT_EQ(copy, test::numbered_frame(kItemSize, frame));
  }
  EXPECT_EQ(jump({.frame = 1000}), "frame 1000: a has 1000 frames");
  EXPECT_TRUE(plays("a", 999));
}

TEST_F(PlaylistSteer, AJumpDiscardsFramesFilledBefore) {
  shelf.put("slow", {0, {.geometry = kItemSize, .frames = 100, .rate = frames::Rate{1, 2}}});
  shelf.put("b", {500, {.geometry = kItemSize, .frames = 50}});
  start(playlist_of(parse_source("slow"), kForever));
  ASSERT_TRUE(within_timeout([&] { return plays("slow", 0); }));
  ASSERT_EQ(jump({.list = other("b")}), "");
  ASSERT_TRUE(within_timeout([&] { return control.displayed().frames > 1; }));
  ASSERT_TRUE(within_timeout([&] { return recorder->shown().size() > 1; }));
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

TEST_F(PlaylistSteer, TheLastOfManyJumpsCounts) {
  shelf.put("a", {0, {.geometry = kItemSize, .frames = 1000}});
  start(playlist_of(parse_source("a"), kForever));
  ASSERT_TRUE(is_moving());
  pause_still();
  std::atomic<int> answers{0};
  constexpr int kJumps = 200;
  for (uint64_t frame = 0; frame < kJumps; ++frame)
    source->jump({.frame = frame}, [&](const Error*) { ++answers; });
  ASSERT_TRUE(within_timeout([&] { return answers.load() == kJumps; }));
  EXPECT_TRUE(within_timeout([&] { return plays("a", kJumps - 1); }));
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

}  // namespace
}  // namespace lenticule::player
