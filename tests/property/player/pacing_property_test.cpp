// SPDX-License-Identifier: Apache-2.0
// Tests the pacer with a display and a source that fail at random, with counts kept separately.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "player/playback/pacing.h"

namespace lenticule::player {
namespace {

using frames::Rate;

struct Faults {
  double late_frame = 0.0;   ///< probability that a frame is not ready when it is due
  double missed_flip = 0.0;  ///< probability that a flip completes late
  uint64_t longest = 5;      ///< vblanks
};

struct Flip {
  uint64_t frame = 0;
  uint64_t vblank = 0;
};

/// The events that really happened, counted without the pacer.
struct ExpectedCounts {
  std::vector<Flip> flips;
  uint64_t starved_vblanks = 0;
  uint64_t missed_vblanks = 0;
  int longest_drop = 0;
};

class Model {
 public:
  Model(Pacer& pacer, Faults faults, uint64_t seed)
      : pacer_(pacer), faults_(faults), random_(seed) {}

  /// Plays until frame `last` is shown, starting at vblank `vblank`.
  ExpectedCounts play(uint64_t last, uint64_t vblank) {
    while (pacer_.frame() <= last) vblank = step(vblank);
    return expected_;
  }

 private:
  /// Makes one decision at vblank `now`; returns the vblank of the next one.
  uint64_t step(uint64_t now) {
    int drops = 0;
    while (true) {
      const uint64_t frame = pacer_.frame();
      switch (pacer_.decide(now + 1, delay_left_ == 0)) {
        case PaceDecision::Later:
          return pacer_.due() - 1;
        case PaceDecision::Starved:
          ++expected_.starved_vblanks;
          --delay_left_;
          return now + 1;
        case PaceDecision::Skip:
          expected_.longest_drop = std::max(expected_.longest_drop, ++drops);
          break;
        case PaceDecision::Submit:
          return flip(frame, now + 1);
      }
    }
  }

  uint64_t flip(uint64_t frame, uint64_t target) {
    const uint64_t delay = expected_.flips.empty() ? 0 : some_delay(faults_.missed_flip);
    pacer_.submitted(target);
    pacer_.flipped(target + delay);
    expected_.missed_vblanks += delay;
    expected_.flips.push_back({frame, target + delay});
    delay_left_ = some_delay(faults_.late_frame);
    return target + delay;
  }

  uint64_t some_delay(double probability) {
    if (std::uniform_real_distribution<>(0.0, 1.0)(random_) >= probability) return 0;
    return std::uniform_int_distribution<uint64_t>(1, faults_.longest)(random_);
  }

  Pacer& pacer_;
  Faults faults_;
  std::mt19937_64 random_;
  uint64_t delay_left_ = 0;
  ExpectedCounts expected_;
};

struct Case {
  LatePolicy policy;
  Rate content;
};

class PacingProperty : public testing::TestWithParam<Case> {};

constexpr Rate kRefresh{60, 1};
constexpr uint64_t kSeed = 99;

TEST_P(PacingProperty, CountsAddUpDespiteFaults) {
  for (uint64_t seed = kSeed; seed < kSeed + 20; ++seed) {
    Pacer pacer(GetParam().content, kRefresh, GetParam().policy);
    Model model(pacer, {.late_frame = 0.05, .missed_flip = 0.05, .longest = 30}, seed);
    const ExpectedCounts expected = model.play(5000, seed * 1000);
    const PaceCounts& counts = pacer.counts();

    for (size_t i = 1; i < expected.flips.size(); ++i) {
      ASSERT_GT(expected.flips[i].vblank, expected.flips[i - 1].vblank)
          << "two flips at one vblank";
      ASSERT_GT(expected.flips[i].frame, expected.flips[i - 1].frame)
          << "a frame twice or backwards";
    }
    EXPECT_EQ(counts.shown, expected.flips.size());
    EXPECT_EQ(counts.vblanks, expected.flips.back().vblank - expected.flips.front().vblank + 1);
    EXPECT_EQ(counts.vblanks, counts.shown + counts.repeated_planned + counts.repeated_underrun +
                                  counts.missed + counts.held);
    EXPECT_EQ(pacer.frame(), counts.shown + counts.dropped + counts.skipped_planned);
    EXPECT_EQ(counts.repeated_underrun, expected.starved_vblanks);
    EXPECT_EQ(counts.missed, expected.missed_vblanks);
    EXPECT_EQ(counts.held, 0u);
    EXPECT_LE(expected.longest_drop, kMaxConsecutiveDrops);
    const bool may_drop = GetParam().policy == LatePolicy::Drop;
    EXPECT_TRUE(may_drop || counts.dropped == 0);
  }
}

TEST_P(PacingProperty, WithoutFaultsEveryFrameIsAtItsIdealVblank) {
  Pacer pacer(GetParam().content, kRefresh, GetParam().policy);
  const Rate content = pacer.content_rate();
  Model model(pacer, {}, kSeed);
  const ExpectedCounts expected = model.play(100'000, uint64_t{400} * 24 * 3600 * 60);
  const uint64_t first = expected.flips.front().vblank;
  for (const Flip& flip : expected.flips) {
    const uint64_t ideal = flip.frame * 60 * static_cast<uint64_t>(content.denominator) /
                           static_cast<uint64_t>(content.numerator);
    ASSERT_EQ(flip.vblank - first, ideal) << "frame " << flip.frame;
  }
  EXPECT_EQ(pacer.counts().slipped + pacer.counts().missed + pacer.counts().dropped, 0u);
}

TEST_P(PacingProperty, DropReturnsToTheFirstScheduleAfterShortFaults) {
  if (GetParam().policy != LatePolicy::Drop) return;
  for (uint64_t seed = kSeed; seed < kSeed + 20; ++seed) {
    Pacer pacer(GetParam().content, kRefresh, LatePolicy::Drop);
    const Rate content = pacer.content_rate();
    // Faults too short for eight late frames in a row.
    (void)Model(pacer, {.late_frame = 0.02, .missed_flip = 0.02, .longest = 2}, seed).play(2000, 7);
    Model calm(pacer, {}, seed);
    const uint64_t first = pacer.first_vblank();
    const ExpectedCounts expected = calm.play(2200, pacer.due() - 1);
    const Flip& last = expected.flips.back();
    EXPECT_EQ(last.vblank - first, last.frame * 60 * static_cast<uint64_t>(content.denominator) /
                                       static_cast<uint64_t>(content.numerator));
    EXPECT_EQ(pacer.counts().slipped, 0u);
  }
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const LatePolicy policy : {LatePolicy::Slip, LatePolicy::Drop, LatePolicy::Hold})
    for (const Rate content : {Rate{24, 1}, Rate{25, 1}, Rate{30, 1}, Rate{60, 1}, Rate{120, 1},
                               Rate{144, 1}, Rate{7, 3}, Rate{24000, 1001}})
      cases.push_back({policy, content});
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Policies, PacingProperty, testing::ValuesIn(all_cases()),
                         [](const auto& instance) {
                           const Case& c = instance.param;
                           return std::string(late_policy_name(c.policy)) + "_" +
                                  std::to_string(c.content.numerator) + "_" +
                                  std::to_string(c.content.denominator);
                         });

}  // namespace
}  // namespace lenticule::player
