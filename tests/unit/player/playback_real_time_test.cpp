// SPDX-License-Identifier: Apache-2.0
// Tests playing with real threads and a real clock. The assertions hold on slow machines too, since
// the slip policy shows every frame, however late.
#include <gtest/gtest.h>

#include <future>
#include <thread>

#include "base/error.h"
#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "player/session/play_service.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/faulty_display.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;

constexpr frames::FrameGeometry kSmall{.width = 64, .height = 16};
constexpr uint64_t kFrames = 20;

std::unique_ptr<display::Display> fast_display(
    std::shared_ptr<test::RememberingRecorder> recorder) {
  return display::open_virtual_display(
      {.geometry = kSmall, .refresh = {500, 1}, .recorder = std::move(recorder)});
}

TEST(PlaybackInRealTime, ShowsEveryFrameOfEveryLoopWholeAndInOrder) {
  const auto recorder = std::make_shared<test::RememberingRecorder>();
  auto display = fast_display(recorder);
  test::FakeSource source({.geometry = kSmall, .frames = kFrames});
  const PlayResult result = play(*display, source, {.loops = 10, .source_name = "fake"});
  display.reset();

  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.pace.shown, 10 * kFrames);
  EXPECT_EQ(result.report.pace.dropped, 0u);
  EXPECT_EQ(source.acquired(), 0u);
  const auto shown = recorder->shown();
  EXPECT_EQ(shown.size() + recorder->skipped(), 10 * kFrames);
  for (size_t i = 0; i < shown.size(); ++i) {
    const bool in_order = i == 0 || shown[i].id > shown[i - 1].id;
    EXPECT_TRUE(in_order) << "frame " << shown[i].id;
    EXPECT_EQ(shown[i].checksum,
              test::checksum_of(test::numbered_frame(kSmall, shown[i].id % kFrames).view()));
  }
}

TEST(PlaybackInRealTime, StopsOnRequest) {
  const auto display = fast_display(nullptr);
  test::FakeSource source({.geometry = kSmall, .frames = kFrames});
  WakeFd stop;
  std::thread stopper([&stop] {
    std::this_thread::sleep_for(milliseconds(50));
    stop.signal();
  });
  const PlayResult result =
      play(*display, source, {.loops = kForever, .stop_fd = stop.fd(), .source_name = "fake"});
  stopper.join();
  EXPECT_EQ(result.outcome, PlayOutcome::Stopped);
  EXPECT_EQ(source.acquired(), 0u);
}

TEST(PlaybackInRealTime, StopsWhileItWaitsForTheFirstFrame) {
  const auto display = fast_display(nullptr);
  const auto never = std::make_shared<display::SimulatedClock>();
  test::FakeSource source({.geometry = kSmall,
                           .ready_at = [](uint64_t) { return std::chrono::hours(1); },
                           .clock = never});
  WakeFd stop;
  stop.signal();
  EXPECT_EQ(play(*display, source, {.stop_fd = stop.fd(), .source_name = "fake"}).outcome,
            PlayOutcome::Stopped);
}

TEST(PlaybackInRealTime, AnUnwritableReportEndsPlaying) {
  const auto display = fast_display(nullptr);
  test::FakeSource source({.geometry = kSmall, .frames = kFrames});
  int reports = 0;
  const PlaybackOptions options{.loops = kForever,
                                .on_report =
                                    [&](const PlayReport& report) {
                                      ++reports;
                                      EXPECT_EQ(report.outcome, "playing");
                                      EXPECT_GT(report.pace.shown, 0u);
                                      throw Error(ErrorKind::Failed, "the disk is full");
                                    },
                                .source_name = "fake"};
  EXPECT_THROW((void)play(*display, source, options), Error);
  EXPECT_EQ(reports, 1);
}

enum class Stage { Source, FrameCopier, Presenter, Display };

/// Plays with one stage that stops after a few frames until a report names the stage that stands
/// still, and returns that text.
class HaltingPlayback final : public test::PlainSource, public test::VirtualFaults {
 public:
  explicit HaltingPlayback(Stage halts) : halts_(halts) {}

  [[nodiscard]] static std::string stage_named_for(Stage halts) {
    const auto faults = std::make_shared<HaltingPlayback>(halts);
    const auto display = test::open_virtual_display({.geometry = kSmall}, faults);
    WakeFd stop;
    std::string named;
    (void)play(*display, *faults,
               {.content = frames::Rate{1, 1},
                .stop_fd = stop.fd(),
                .on_report = [&](const PlayReport& report) {
                  named = stalled_stage(report.delays);
                  if (named.empty()) return;
                  faults->over_.set_value();
                  stop.signal();
                }});
    return named;
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return kSmall; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (number_ >= 2 && halts_ == Stage::Source) return frames::PullStatus::NotYet;
    if (number_ >= 2 && halts_ == Stage::FrameCopier) is_over_.wait();
    out = {.frame = pixels_.view(), .number = number_++};
    return frames::PullStatus::Ready;
  }

  [[nodiscard]] test::EventFate fate(uint64_t sequence) noexcept override {
    const bool dropped = halts_ == Stage::Display && sequence > 5;
    return dropped ? test::EventFate::Drop : test::EventFate::Deliver;
  }
  [[nodiscard]] display::Nanoseconds event_delay(uint64_t sequence) noexcept override {
    if (halts_ == Stage::Presenter && sequence > 5) is_over_.wait();
    return display::Nanoseconds{0};
  }

 private:
  const Stage halts_;
  frames::WovenFrame pixels_{kSmall};
  uint64_t number_ = 0;
  std::promise<void> over_;
  const std::shared_future<void> is_over_ = over_.get_future().share();
};

TEST(PlaybackInRealTime, NamesTheStageThatStandsStill) {
  const auto named = [](Stage halts) {
    return std::async(std::launch::async, HaltingPlayback::stage_named_for, halts);
  };
  auto source = named(Stage::Source), frame_copier = named(Stage::FrameCopier);
  auto presenter = named(Stage::Presenter), display = named(Stage::Display);
  EXPECT_EQ(source.get(), "no frame arrives");
  EXPECT_EQ(frame_copier.get(), "the frame copier stands still");
  EXPECT_EQ(presenter.get(), "the presenter stands still");
  EXPECT_EQ(display.get(), "the display reports no vblank");
}

}  // namespace
}  // namespace lenticule::player
