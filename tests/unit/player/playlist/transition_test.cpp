// SPDX-License-Identifier: Apache-2.0
// Tests transitions: each pixel of their frames against an oracle, and each vblank in simulated
// time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <random>
#include <thread>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
#include "tests/support/fakes/faulty_display.h"
#include "tests/unit/player/playlist/fake_items.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;
using test::kItemSize;
using test::list_of;
using test::numbered_frame;

double light_of(uint8_t code) {
  const double encoded = code / 255.0;
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}
double code_of(double light) {
  return 255.0 * (light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1 / 2.4) - 0.055);
}

/// Expects `first` parts of the light of shelf frame `a` and `second` parts of that of frame `b`.
void expect_mix(const frames::WovenFrame& shown, double first, uint64_t a, double second,
                uint64_t b) {
  const frames::WovenFrame from = numbered_frame(kItemSize, a), to = numbered_frame(kItemSize, b);
  for (size_t n = 0; n < shown.bytes().size(); ++n)
    ASSERT_NEAR(shown.bytes()[n],
                code_of(first * light_of(from.bytes()[n]) + second * light_of(to.bytes()[n])), 1.0)
        << "subpixel " << n << " of " << first << " x " << a << " + " << second << " x " << b;
}

class Transitions : public testing::Test {
 protected:
  test::FakeShelf shelf;
  std::unique_ptr<PlaylistSource> source;

  void put(const std::string& name, uint64_t base, uint64_t frames) {
    shelf.put(name, {base, {.geometry = kItemSize, .frames = frames, .rate = frames::Rate{60, 1}}});
  }
  [[nodiscard]] PlaylistSource& open(Playlist list) {
    source = std::make_unique<PlaylistSource>(
        std::make_shared<const Playlist>(std::move(list)),
        PlaylistSourceOptions{.panel = kItemSize, .open = shelf.opener()});
    source->open_first();
    return *source;
  }
  /// Returns the next frame; none at the end.
  [[nodiscard]] std::optional<frames::AcquiredFrame> next() const {
    frames::AcquiredFrame frame;
    while (true) {
      const PullStatus status = source->pull(frame);
      if (status == PullStatus::Ready) return frame;
      if (status != PullStatus::NotYet) return std::nullopt;
      source->service();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  [[nodiscard]] static frames::WovenFrame copy_of(const frames::FrameView& view) {
    frames::WovenFrame copy(view.geometry);
    std::ranges::copy(view.bytes, copy.bytes().begin());
    return copy;
  }
  /// Returns copies of the next frames, at most so many.
  [[nodiscard]] std::vector<frames::WovenFrame> take(size_t most) const {
    std::vector<frames::WovenFrame> taken;
    while (taken.size() < most) {
      const auto frame = next();
      if (!frame) break;
      taken.push_back(copy_of(frame->frame));
      source->release(frame->token);
    }
    return taken;
  }
  /// Jumps, and returns once the target's first frame is there.
  [[nodiscard]] std::string jump(const std::function<void(const JumpDone&)>& call) const {
    std::optional<std::string> outcome;
    std::mutex mutex;
    call([&](const Error* error) {
      const std::lock_guard lock(mutex);
      outcome = error ? error->what() : "";
    });
    while (true) {
      {
        const std::lock_guard lock(mutex);
        if (outcome) return *outcome;
      }
      source->service();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  [[nodiscard]] static Playlist list_with(TransitionKind kind, double seconds) {
    Playlist list = list_of({"a", "b"});
    list.transition = kind;
    list.transition_s = seconds;
    return list;
  }
};

TEST_F(Transitions, ACrossFadeMixesTheHeldFrameWithTheRunningOnes) {
  put("a", 0, 3);
  put("b", 10, 6);
  (void)open(list_with(TransitionKind::Cross, 0.05));
  const std::vector<frames::WovenFrame> shown = take(100);
  ASSERT_EQ(shown.size(), 9U) << "a transition takes no time of its own";
  for (uint64_t k = 0; k < 3; ++k) EXPECT_EQ(shown[k], numbered_frame(kItemSize, k));
  for (uint64_t k = 0; k < 3; ++k) {
    const double way = static_cast<double>(k + 1) / 4;
    expect_mix(shown[3 + k], 1 - way, 2, way, 10 + k);
  }
  for (uint64_t k = 3; k < 6; ++k) EXPECT_EQ(shown[3 + k], numbered_frame(kItemSize, 10 + k));
}

TEST_F(Transitions, AFilmShorterThanItsTransitionShortensIt) {
  put("a", 0, 1);
  put("b", 10, 3);
  (void)open(list_with(TransitionKind::Cross, 1.0));
  const std::vector<frames::WovenFrame> shown = take(100);
  ASSERT_EQ(shown.size(), 4U);
  for (uint64_t k = 0; k < 3; ++k) {
    const double way = static_cast<double>(k + 1) / 4;
    expect_mix(shown[1 + k], 1 - way, 0, way, 10 + k);
  }
}

TEST_F(Transitions, AFadeGoesThroughBlack) {
  put("a", 0, 1);
  put("b", 10, 8);
  (void)open(list_with(TransitionKind::Fade, 7.0 / 60));
  const std::vector<frames::WovenFrame> shown = take(100);
  ASSERT_EQ(shown.size(), 9U);
  for (uint64_t k = 0; k < 3; ++k)
    expect_mix(shown[1 + k], 1 - 2 * static_cast<double>(k + 1) / 8, 0, 0, 0);
  EXPECT_EQ(shown[4], frames::WovenFrame(kItemSize)) << "black in the middle";
  for (uint64_t k = 4; k < 7; ++k)
    expect_mix(shown[1 + k], 0, 0, 2 * static_cast<double>(k + 1) / 8 - 1, 10 + k);
  EXPECT_EQ(shown[8], numbered_frame(kItemSize, 17));
}

TEST_F(Transitions, AnItemSaysHowItFollows) {
  for (const char* name : {"a", "b", "c", "d"}) put(name, 10 * (name[0] - 'a'), 2);
  Playlist list = list_of({"a", "b", "c", "d"});
  list.transition = TransitionKind::Cross;
  list.transition_s = 1.0 / 60;
  list.items[1].transition = TransitionKind::Cut;
  list.items[3].transition = TransitionKind::Fade;
  (void)open(list);
  const std::vector<frames::WovenFrame> shown = take(100);
  ASSERT_EQ(shown.size(), 8U);
  EXPECT_EQ(shown[2], numbered_frame(kItemSize, 10));
  expect_mix(shown[4], 0.5, 11, 0.5, 20);
  EXPECT_EQ(shown[6], frames::WovenFrame(kItemSize));
}

TEST_F(Transitions, FramesStayUnchangedUntilTheyAreReleasedHoweverManyAreKept) {
  put("a", 0, 20);
  put("b", 30, 20);
  Playlist list = list_with(TransitionKind::Cross, 0.2);
  list.rounds = kForever;
  (void)open(list);
  std::mt19937 random(1);
  struct Lent {
    frames::AcquiredFrame frame;
    frames::WovenFrame copy;
  };
  std::deque<Lent> lent;
  for (int n = 0; n < 2000; ++n) {
    const auto most = static_cast<size_t>(std::min(7, source->max_acquired()));
    while (!lent.empty() && (lent.size() >= most || random() % 4 == 0)) {
      const auto one = lent.begin() + static_cast<ptrdiff_t>(random() % lent.size());
      ASSERT_EQ(copy_of(one->frame.frame), one->copy);
      source->release(one->frame.token);
      lent.erase(one);
    }
    const auto frame = next();
    ASSERT_TRUE(frame);
    lent.push_back({*frame, copy_of(frame->frame)});
  }
  for (const Lent& one : lent) source->release(one.frame.token);
}

TEST_F(Transitions, AJumpInTheMiddleCuts) {
  put("a", 0, 3);
  put("b", 10, 60);
  put("c", 100, 60);
  Playlist list = list_of({"a", "b", "c"}, kForever);
  list.transition = TransitionKind::Cross;
  (void)open(list);
  (void)take(10);
  ASSERT_EQ(jump([&](const JumpDone& done) { source->jump({.item = 1, .relative = true}, done); }),
            "");
  EXPECT_EQ(take(2), (std::vector{numbered_frame(kItemSize, 100), numbered_frame(kItemSize, 101)}));
}

TEST_F(Transitions, GoInTheMiddleCuts) {
  put("a", 0, 3);
  put("b", 10, 60);
  put("c", 100, 60);
  Playlist list = list_of({"a", "b", "c"}, kForever);
  list.transition = TransitionKind::Fade;
  (void)open(list);
  (void)take(10);
  ASSERT_EQ(jump([&](const JumpDone& done) { source->cue({.item = 2}, done); }), "");
  (void)take(2);
  ASSERT_EQ(jump([&](const JumpDone& done) { source->go(done); }), "");
  EXPECT_EQ(take(1).front(), numbered_frame(kItemSize, 100));
}

TEST_F(Transitions, APictureInterruptedInItsFadeStaysForTheRestOfItsSeconds) {
  put("a", 0, 3);
  put("evacuate", 100, 5);
  shelf.put("still", {10, {.geometry = kItemSize, .frames = 1}});
  Playlist list = list_of({"a", "still"});
  list.items[1].still_s = 1.0;
  list.items[1].transition = TransitionKind::Cross;
  (void)open(list);
  (void)take(3 + 15);  // a quarter of the second, at 60 Hz
  const auto other = std::make_shared<const Playlist>(list_of({"evacuate"}));
  ASSERT_EQ(jump([&](const JumpDone& done) {
              source->jump({.list = other, .item = 0, .interrupts = true}, done);
            }),
            "");
  const std::vector<frames::WovenFrame> shown = take(100);
  ASSERT_EQ(shown.size(), 5U + 3) << "three quarters, at 4 Hz";
  for (size_t k = 5; k < shown.size(); ++k) EXPECT_EQ(shown[k], numbered_frame(kItemSize, 10));
}

/// Plays in simulated time.
class TransitionTimes : public Transitions {
 protected:
  std::shared_ptr<display::SimulatedClock> clock = std::make_shared<display::SimulatedClock>();
  std::shared_ptr<test::RememberingRecorder> recorder =
      std::make_shared<test::RememberingRecorder>();
  PlaybackControl control;

  PlayResult play_list(Playlist list, std::shared_ptr<test::VirtualFaults> faults = nullptr) {
    const auto display = test::open_virtual_display(
        {.geometry = kItemSize, .refresh = {60, 1}, .clock = clock, .recorder = recorder},
        std::move(faults));
    PlayResult result =
        play(*display, open(std::move(list)),
             {.filling = Filling::InPresenter, .control = &control, .source_name = "list"});
    EXPECT_EQ(result.outcome, PlayOutcome::Finished);
    EXPECT_EQ(result.report.pace.missed, 0U);
    EXPECT_EQ(result.report.pace.underruns, 0U);
    return result;
  }
  [[nodiscard]] static uint64_t checksum(uint64_t number) {
    return test::checksum_of(numbered_frame(kItemSize, number).view());
  }
};

TEST_F(TransitionTimes, EachRefreshShowsAStepOfAStillPictureThatStaysAsLongAsWithoutOne) {
  put("a", 0, 3);
  shelf.put("still", {10, {.geometry = kItemSize, .frames = 1}});
  put("c", 20, 3);
  Playlist list = list_of({"a", "still", "c"});
  list.items[1].still_s = 1.0;
  list.items[1].transition = TransitionKind::Cross;
  play_list(list);
  const std::vector<test::DisplayedFrame> shown = recorder->shown();
  ASSERT_EQ(shown.size(), 3U + 30 + 2 + 3);
  std::set<uint64_t> steps;
  for (size_t k = 3; k < 33; ++k) {
    EXPECT_EQ(shown[k].sequence, shown[k - 1].sequence + 1);
    steps.insert(shown[k].checksum);
  }
  EXPECT_EQ(steps.size(), 30U);
  EXPECT_FALSE(steps.contains(checksum(2)) || steps.contains(checksum(10)));
  EXPECT_EQ(shown[33].checksum, checksum(10));
  EXPECT_EQ(shown[33].sequence, shown[32].sequence + 1);
  EXPECT_EQ(shown[35].checksum, checksum(20));
  EXPECT_EQ(shown[35].sequence, shown[3].sequence + 60) << "a second";
}

TEST_F(TransitionTimes, APictureStaysForItsSecondsWhateverItsRate) {
  put("a", 0, 3);
  for (const auto& [name, rate] : {std::pair("slow", 1), {"own", 4}, {"odd", 7}})
    shelf.put(name, {10, {.geometry = kItemSize, .frames = 1, .rate = frames::Rate{rate, 1}}});
  Playlist list = list_of({"a", "slow", "own", "odd", "a"});
  for (PlaylistItem& item : list.items)
    if (item.source.text != "a") item.duration_s = 1.0;
  list.transition = TransitionKind::Cross;
  list.transition_s = 0.3;
  EXPECT_EQ(play_list(list).report.pace.vblanks, 3U + 3 * 60 + 3);
  list.items[2].duration_s = 0.2;  // shorter than the transition
  EXPECT_EQ(play_list(list).report.pace.vblanks, 3U + 2 * 60 + 12 + 3);
}

TEST_F(TransitionTimes, NoVblankIsMissedAndNoLengthChangesInTwentyRounds) {
  put("a", 0, 20);
  put("b", 30, 20);
  shelf.put("still", {50, {.geometry = kItemSize, .frames = 1}});
  Playlist list = list_of({"a", "still", "b"}, 20);
  list.items[1].still_s = 0.5;
  list.transition = TransitionKind::Fade;
  list.transition_s = 0.25;
  const PlayResult result = play_list(list);
  EXPECT_EQ(source->status().started, 60U);
  EXPECT_EQ(result.report.pace.vblanks, 20U * (20 + 30 + 20));
}

/// Pauses before a vblank, and continues before another one.
class Pauses final : public test::VirtualFaults {
 public:
  explicit Pauses(PlaybackControl& control) : control_(control) {}
  test::EventFate fate(uint64_t sequence) noexcept override {
    if (sequence == 8 || sequence == 40) control_.pause(sequence == 8);
    return test::EventFate::Deliver;
  }
  display::Nanoseconds event_delay(uint64_t) noexcept override { return display::Nanoseconds{0}; }

 private:
  PlaybackControl& control_;
};

TEST_F(TransitionTimes, APauseInTheMiddleHoldsOneStepAndThenTheNextFollows) {
  put("a", 0, 3);
  put("b", 10, 20);
  const Playlist list = list_with(TransitionKind::Cross, 10.0 / 60);
  play_list(list);
  const std::vector<test::DisplayedFrame> without = recorder->shown();
  recorder = std::make_shared<test::RememberingRecorder>();
  const PlayResult result = play_list(list, std::make_shared<Pauses>(control));
  const std::vector<test::DisplayedFrame> with = recorder->shown();
  ASSERT_EQ(with.size(), without.size());
  for (size_t k = 0; k < with.size(); ++k) EXPECT_EQ(with[k].checksum, without[k].checksum) << k;
  EXPECT_GT(result.report.pace.held, 25U);
}

}  // namespace
}  // namespace lenticule::player
