// SPDX-License-Identifier: Apache-2.0
// Tests the whole player on a fake card in simulated time: a million vblanks whose events come up
// to 0.9 of a period late, 400 days after the machine's start, while the driver's counter wraps
// around.
#include <malloc.h>

#include <array>
#include <cstring>
#include <random>

#include "player/playback/playback.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/unit/kms/kms_stage.h"

namespace lenticule::test {
namespace {

constexpr uint64_t kVblanks = 1'000'000;
constexpr uint64_t kFramesPerLoop = 7;
constexpr uint64_t kFlips = (kVblanks * 5 + 11) / 12;

/// Returns the mode of a panel of exactly 60 Hz.
drmModeModeInfo exact_sixty() {
  drmModeModeInfo mode = make_mode(kWidth, kHeight, 60);
  mode.htotal = 100;
  mode.vtotal = 100;
  mode.clock = 600;
  return mode;
}

/// Checks every flip as the card accepts it, and stores none.
class FlipChecker {
 public:
  FlipChecker() {
    for (uint64_t k = 0; k < kFramesPerLoop; ++k)
      rows_.at(k) = words_of(test::numbered_frame(kPanel, k));
  }

  void check(uint64_t sequence, const FakeBuffer& buffer) {
    if (flips_ == 0) first_ = sequence;
    const bool in_time = sequence - first_ == flips_ * 12 / 5;
    const auto& row = rows_.at(flips_ % kFramesPerLoop);
    const bool whole = std::memcmp(buffer.bytes.data(), row.data(), 4 * kWidth) == 0;
    if (!in_time || !whole) ++wrong_;
    ++flips_;
    if (flips_ == kFlips / 10) memory_early_ = mallinfo2().uordblks;
    if (flips_ == kFlips - 1) memory_late_ = mallinfo2().uordblks;
  }
  [[nodiscard]] uint64_t flips() const { return flips_; }
  [[nodiscard]] uint64_t wrong() const { return wrong_; }
  [[nodiscard]] uint64_t first() const { return first_; }
  /// Returns by how many bytes the memory in use grew in the last nine tenths of the run.
  [[nodiscard]] int64_t growth() const {
    return static_cast<int64_t>(memory_late_) - static_cast<int64_t>(memory_early_);
  }

 private:
  std::array<std::vector<uint32_t>, kFramesPerLoop> rows_;
  uint64_t first_ = 0;
  uint64_t flips_ = 0;
  uint64_t wrong_ = 0;
  size_t memory_early_ = 0;
  size_t memory_late_ = 0;
};

}  // namespace

class KmsPlayback : public KmsStage {};

TEST_F(KmsPlayback, AMillionVblanksWithJitterHaveNoGapAndConstantMemory) {
  machine.advance_to(std::chrono::hours(24 * 400));
  connector->modes = {exact_sixty()};
  card.sequence_base =
      (uint64_t{1} << 32) - kVblanks / 2 - static_cast<uint64_t>(machine.now() / card.period);
  std::mt19937 random(42);
  card.event_delay = [&] { return Nanoseconds(random() % 15'000'000); };
  FlipChecker checker;
  card.on_flip = [&](uint64_t sequence, const FakeBuffer& buffer) {
    checker.check(sequence, buffer);
  };
  open();
  ASSERT_EQ(show->mode().refresh, frames::make_rate(60, 1));
  test::FakeSource source({.geometry = kPanel, .frames = kFramesPerLoop});
  const player::PlayResult result = player::play(*show, source,
                                                 {.content = frames::Rate{25, 1},
                                                  .loops = player::kForever,
                                                  .vblanks = kVblanks,
                                                  .filling = player::Filling::InPresenter,
                                                  .source_name = "fake"});

  EXPECT_EQ(result.outcome, player::PlayOutcome::Finished);
  const player::PaceCounts& pace = result.report.pace;
  EXPECT_EQ(pace.vblanks, kVblanks);
  EXPECT_EQ(pace.shown, kFlips);
  EXPECT_EQ(pace.missed + pace.repeated_underrun + pace.dropped + pace.held, 0U);
  EXPECT_EQ(checker.flips(), kFlips);
  EXPECT_EQ(checker.wrong(), 0U);
  EXPECT_LT(checker.first(), uint64_t{1} << 32);
  EXPECT_GT(checker.first() + kVblanks, uint64_t{1} << 32) << "the counter wrapped meanwhile";
  EXPECT_LE(checker.growth(), 4096) << "bytes";
  const display::KmsStatistics kms = show->statistics();
  EXPECT_EQ(kms.flips, kFlips);
  EXPECT_EQ(kms.flip_timeouts, 0U);
  EXPECT_EQ(kms.stray_events, 0U);
  EXPECT_EQ(kms.lost_ticks, 0U);
  EXPECT_EQ(kms.busy, 0U);
  EXPECT_TRUE(kms.hardware_clock);
}

}  // namespace lenticule::test
