// SPDX-License-Identifier: Apache-2.0
// Tests a million vblanks with jitter in simulated time: nothing is missed, every loop point is
// exact.
#include <gtest/gtest.h>

#include <array>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "tests/support/fakes/fake_source.h"

namespace lenticule::player {
namespace {

constexpr frames::FrameGeometry kTiny{.width = 8, .height = 2};
constexpr uint64_t kVblanks = 20'000;
constexpr uint64_t kFramesPerLoop = 7;

/// Checks every shown frame as it comes, and stores none.
class LoopPointChecker final : public display::ScanoutRecorder {
 public:
  LoopPointChecker() {
    for (uint64_t k = 0; k < kFramesPerLoop; ++k) {
      const frames::WovenFrame frame = test::numbered_frame(kTiny, k);
      first_pixels_[k] = uint32_t{frame.bytes()[0]} << 16 | uint32_t{frame.bytes()[1]} << 8 |
                         uint32_t{frame.bytes()[2]};
    }
  }
  void record(const display::ShownFrame& shown,
              const display::ScanoutView& scanout) noexcept override {
    if (frames_ == 0) first_vblank_ = shown.sequence;
    const bool right = shown.id == frames_ && shown.sequence - first_vblank_ == frames_ * 12 / 5 &&
                       scanout.row(0)[0] == first_pixels_[frames_ % kFramesPerLoop];
    wrong_ += right ? 0 : 1;
    ++frames_;
  }
  void finish() override {}
  [[nodiscard]] uint64_t frames() const { return frames_; }
  [[nodiscard]] uint64_t wrong() const { return wrong_; }

 private:
  std::array<uint32_t, kFramesPerLoop> first_pixels_{};
  uint64_t first_vblank_ = 0;
  uint64_t frames_ = 0;
  uint64_t wrong_ = 0;
};

TEST(PlaybackSoak, JitterMakesNoGapAtTheLoopPoint) {
  const auto checker = std::make_shared<LoopPointChecker>();
  // Started 400 days ago, with events up to 0.9 of a period late.
  const auto clock = std::make_shared<display::SimulatedClock>(std::chrono::hours(400 * 24));
  const auto display = display::open_virtual_display(
      {.geometry = kTiny,
       .refresh = {60, 1},
       .clock = clock,
       .faults = std::make_shared<display::UniformJitter>(std::chrono::milliseconds(15), 42),
       .recorder = checker});
  test::FakeSource source({.geometry = kTiny, .frames = kFramesPerLoop});
  const PlayResult result = play(*display, source,
                                 {.content = frames::Rate{25, 1},
                                  .loops = kForever,
                                  .vblanks = kVblanks,
                                  .filling = Filling::InPresenter,
                                  .source_name = "fake"});

  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  const PaceCounts& pace = result.report.pace;
  EXPECT_EQ(pace.vblanks, kVblanks);
  EXPECT_EQ(pace.shown, (kVblanks * 5 + 11) / 12);
  EXPECT_EQ(pace.missed + pace.repeated_underrun + pace.dropped + pace.held, 0u);
  EXPECT_EQ(checker->frames(), pace.shown);
  EXPECT_EQ(checker->wrong(), 0u);
}

}  // namespace
}  // namespace lenticule::player
