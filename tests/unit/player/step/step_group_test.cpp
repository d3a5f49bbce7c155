// SPDX-License-Identifier: Apache-2.0
// Tests players in step on simulated panels, clocks and networks: time passes only in the test.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <queue>
#include <random>

#include "player/playback/pacing.h"
#include "player/step/step_member.h"
#include "player/step/step_pacing.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr uint64_t kLoop = 90;
constexpr nanoseconds kTick = milliseconds(100);
constexpr nanoseconds kPeriod{16'666'667};

nanoseconds scaled(nanoseconds time, double factor) {
  return nanoseconds(static_cast<int64_t>(static_cast<double>(time.count()) * factor));
}

/// A machine with a panel and two clocks.
struct Machine {
  double panel_ppm = 0.0;  ///< the period of the panel is longer by this
  nanoseconds panel_phase{0};
  nanoseconds booted{0};       ///< CLOCK_MONOTONIC less true time
  nanoseconds clock_error{0};  ///< CLOCK_REALTIME less true time
  frames::Rate content{60, 1};
};

/// A player process on a machine; `leader` says its role.
class SimulatedPlayer {
 public:
  SimulatedPlayer(const Machine& machine, nanoseconds time, bool leader, uint64_t session)
      : machine_(machine),
        clock_(reading(time)),
        pacer_(machine.content, {60, 1}, LatePolicy::Drop),
        shown_at_(kLoop, seconds(-1000)) {
    StepIdentity identity{.group = "lobby", .key = StepKey({1, 2, 3}), .session = session};
    if (leader)
      member_ = std::make_unique<StepLeader>(identity, now(time));
    else
      member_ = std::make_unique<StepFollower>(identity);
  }

  StepNow now(nanoseconds time) { return clock_.now(reading(time)); }
  StepMember& member() { return *member_; }
  [[nodiscard]] StepPlace place() const { return pacing_.place(); }
  [[nodiscard]] bool in_step() const { return pacing_.place().in_step != 0; }
  /// Returns the last time at which the player showed a frame in step.
  [[nodiscard]] nanoseconds shown_at(uint64_t frame) const { return shown_at_[frame]; }

  std::optional<StepBytes> tick(nanoseconds time) {
    const StepNow at = now(time);
    auto message = member_->tick(place(), at);
    follow();
    return message;
  }
  void receive(const StepBytes& bytes, nanoseconds time) {
    (void)member_->receive(bytes, now(time));
    follow();
  }

  /// The vblank `number` happens. Returns the frame that appears, if one does.
  std::optional<uint64_t> vblank(uint64_t number, nanoseconds time) {
    std::optional<uint64_t> appeared;
    if (pending_) {
      appeared = *pending_ % kLoop;
      pacer_.flipped(number);
      pacing_.shown(*appeared, monotonic(time));
      shown_at_[*appeared] = in_step() ? time : nanoseconds(seconds(-1000));
      pending_.reset();
    }
    while (true) {
      if (pacer_.scheduled()) move_schedule(number, time);
      const PaceDecision decision = pacer_.decide(number + 1, true);
      if (decision == PaceDecision::Submit) {
        pending_ = pacer_.frame();
        pacer_.submitted(number + 1);
      }
      if (decision != PaceDecision::Skip) return appeared;
    }
  }

 private:
  [[nodiscard]] nanoseconds monotonic(nanoseconds time) const { return time + machine_.booted; }
  [[nodiscard]] ClockReading reading(nanoseconds time) const {
    return {.monotonic = monotonic(time), .real = time + machine_.clock_error};
  }
  void follow() {
    if (const auto& timeline = member_->timeline())
      pacing_.follow(timeline->on_clock_ahead_by(-clock_.ahead_of_monotonic()));
  }
  void move_schedule(uint64_t number, nanoseconds time) {
    const auto ideal = static_cast<int64_t>(pacer_.vblanks_to_ideal(number) *
                                            static_cast<double>(kPeriod.count()));
    const double shift = pacing_.correction({.frame = pacer_.frame() % kLoop,
                                             .index = pacer_.frame(),
                                             .vblank = number + 1,
                                             .due = monotonic(time) + nanoseconds(ideal),
                                             .period = kPeriod,
                                             .rate = pacer_.content_rate()});
    if (shift != 0.0) pacing_.moved(pacer_.shift(shift));
  }

  const Machine& machine_;
  StepClock clock_;
  Pacer pacer_;
  StepPacing pacing_;
  std::unique_ptr<StepMember> member_;
  std::optional<uint64_t> pending_;
  std::vector<nanoseconds> shown_at_;
};

/// A group on a network that delays, loses and reorders messages. Player 0 is the leader.
class SimulatedGroup {
 public:
  SimulatedGroup(size_t players, frames::Rate content, uint64_t seed) : random_(seed) {
    for (size_t k = 0; k < players; ++k) {
      machines_.push_back(
          {.panel_ppm = -100.0 + 200.0 * static_cast<double>(k) / static_cast<double>(players - 1),
           .panel_phase = below(kPeriod),
           .booted = seconds(1000) + below(seconds(1000)),
           .clock_error = below(microseconds_of(400)) - microseconds_of(200),
           .content = content});
      players_.push_back(nullptr);
      frame_.emplace_back();
    }
    for (size_t k = 0; k < players; ++k) {
      at(below(seconds(1)), [this, k] { start(k); });
      at(machines_[k].panel_phase, [this, k] { vblank(k, 0); });
      at(below(kTick), [this, k] { tick(k); });
    }
  }

  void at(nanoseconds time, std::function<void()> action) {
    events_.push({time, count_++, std::move(action)});
  }
  void run_until(nanoseconds end) {
    while (events_.top().time < end) {
      const Event event = events_.top();
      events_.pop();
      time_ = event.time;
      event.action();
    }
    time_ = end;
  }

  void start(size_t k) {
    players_[k] = std::make_unique<SimulatedPlayer>(machines_[k], time_, k == 0, ++sessions_);
    frame_[k].reset();
  }
  void kill(size_t k) { players_[k].reset(); }
  void step_clock(size_t k, nanoseconds by) { machines_[k].clock_error += by; }
  void disturb_network(bool disturbed) { disturbed_ = disturbed; }
  nanoseconds below(nanoseconds limit) {
    return nanoseconds(std::uniform_int_distribution<int64_t>(0, limit.count() - 1)(random_));
  }
  size_t one_of(size_t count) {
    return std::uniform_int_distribution<size_t>(0, count - 1)(random_);
  }

  [[nodiscard]] nanoseconds time() const { return time_; }
  SimulatedPlayer& player(size_t k) { return *players_[k]; }
  bool alive(size_t k) { return players_[k] != nullptr; }
  /// Returns the largest time between the appearances of one frame on two panels in step, in
  /// vblanks.
  [[nodiscard]] double largest_difference() const { return largest_; }
  [[nodiscard]] uint64_t compared() const { return compared_; }
  [[nodiscard]] uint64_t went_back() const { return went_back_; }
  [[nodiscard]] uint64_t vblanks_in_step(size_t k) const {
    return in_step_.count(k) ? in_step_.at(k) : 0;
  }

 private:
  struct Event {
    nanoseconds time{0};
    uint64_t number = 0;
    std::function<void()> action;
    bool operator<(const Event& other) const {
      return std::tie(time, number) > std::tie(other.time, other.number);
    }
  };
  static nanoseconds microseconds_of(int64_t value) { return std::chrono::microseconds(value); }

  void vblank(size_t k, uint64_t number) {
    const nanoseconds next = scaled((number + 1) * kPeriod, 1.0 + machines_[k].panel_ppm * 1e-6);
    at(machines_[k].panel_phase + next, [this, k, number] { vblank(k, number + 1); });
    if (!players_[k]) return;
    const auto appeared = players_[k]->vblank(number, time_);
    if (players_[k]->in_step()) ++in_step_[k];
    if (!appeared) return;
    // Up to eight frames may be left out; more than half a loop forwards is a frame backwards.
    const uint64_t forwards = frame_[k] ? (*appeared + kLoop - *frame_[k]) % kLoop : 1;
    if (forwards == 0 || forwards > kLoop / 2) ++went_back_;
    frame_[k] = appeared;
    compare(k, *appeared);
  }

  void compare(size_t k, uint64_t frame) {
    if (players_[k]->shown_at(frame) != time_) return;  // was not in step
    for (const auto& other : players_) {
      if (!other || other == players_[k]) continue;
      const nanoseconds ago = time_ - other->shown_at(frame);
      if (ago > seconds(1)) continue;  // not yet shown in this loop, or left out
      ++compared_;
      largest_ = std::max(largest_,
                          static_cast<double>(ago.count()) / static_cast<double>(kPeriod.count()));
    }
  }

  void tick(size_t k) {
    at(time_ + kTick, [this, k] { tick(k); });
    if (!players_[k]) return;
    const auto message = players_[k]->tick(time_);
    if (!message) return;
    if (k > 0) return send(0, *message);
    for (size_t to = 1; to < players_.size(); ++to) send(to, *message);
  }

  void send(size_t to, const StepBytes& bytes) {
    if (disturbed_ && one_of(100) < 5) return;
    const nanoseconds delay = disturbed_ ? below(milliseconds(50)) : milliseconds(1);
    at(time_ + delay, [this, to, bytes] {
      if (players_[to]) players_[to]->receive(bytes, time_);
    });
  }

  std::mt19937_64 random_;
  std::deque<Machine> machines_;
  std::vector<std::unique_ptr<SimulatedPlayer>> players_;
  std::vector<std::optional<uint64_t>> frame_;  ///< last frame of each player
  std::map<size_t, uint64_t> in_step_;
  std::priority_queue<Event> events_;
  uint64_t count_ = 0;
  uint64_t sessions_ = 0;
  nanoseconds time_{0};
  bool disturbed_ = true;
  double largest_ = 0.0;
  uint64_t compared_ = 0;
  uint64_t went_back_ = 0;
};

/// The tolerance of a vblank: each of two players may be 0.05 vblank beyond its half, and clocks
/// differ by 0.4 ms.
constexpr double kOneVblank = 1.15;

void expect_all_in_step(SimulatedGroup& group, size_t players) {
  for (size_t k = 0; k < players; ++k) {
    ASSERT_TRUE(group.alive(k));
    EXPECT_TRUE(group.player(k).in_step()) << "player " << k;
  }
}

class GroupOfRate : public testing::TestWithParam<frames::Rate> {};

TEST_P(GroupOfRate, StaysWithinOneVblankThroughLossDelaysClockStepsAndAHundredDeadLeaders) {
  constexpr size_t kPlayers = 8;
  constexpr seconds kLength{600};
  SimulatedGroup group(kPlayers, GetParam(), 7);
  for (int kill = 1; kill <= 100; ++kill) {
    const nanoseconds when = kill * kLength / 102 + group.below(milliseconds(500));
    group.at(when, [&group] { group.kill(0); });
    group.at(when + milliseconds(50) + group.below(seconds(3)), [&group] { group.start(0); });
  }
  for (nanoseconds when = seconds(20); when < kLength - seconds(30); when += seconds(20)) {
    const size_t k = group.one_of(kPlayers);
    const seconds step{group.one_of(2) == 0 ? 2 : -2};
    group.at(when, [&group, k, step] { group.step_clock(k, step); });
    group.at(when + seconds(1) + group.below(seconds(10)),
             [&group, k, step] { group.step_clock(k, -step); });
  }
  group.run_until(kLength);

  expect_all_in_step(group, kPlayers);
  EXPECT_LE(group.largest_difference(), kOneVblank);
  EXPECT_EQ(group.went_back(), 0u);
  EXPECT_GT(group.compared(), 100'000u);
  for (size_t k = 1; k < kPlayers; ++k) {
    EXPECT_EQ(group.player(k).place().joined, 1u) << k;
    EXPECT_GT(group.vblanks_in_step(k), 580u * 60u) << k;
    EXPECT_LE(group.player(k).place().largest_difference, 600'000) << k;
  }
  RecordProperty("largest_difference", std::to_string(group.largest_difference()));
}

INSTANTIATE_TEST_SUITE_P(Rates, GroupOfRate,
                         testing::Values(frames::Rate{60, 1}, frames::Rate{24, 1}));

TEST(StepGroup, RepeatsOrDropsOneFrameWhenAPanelsVblankHasDrifted) {
  SimulatedGroup group(2, {60, 1}, 3);  // the periods differ by 200 ppm
  group.run_until(seconds(600));
  expect_all_in_step(group, 2);
  // 100 ppm of 36000 vblanks are 3.6 vblanks, after at most half a loop at the start.
  const StepPlace slow = group.player(1).place();
  EXPECT_NEAR(static_cast<double>(slow.drift_ppb), 100'000.0, 5'000.0);
  EXPECT_NEAR(static_cast<double>(group.player(0).place().drift_ppb), -100'000.0, 5'000.0);
  EXPECT_GE(slow.dropped, 3u);
  EXPECT_LE(slow.dropped, kLoop / 2 + 5);
  EXPECT_LE(group.largest_difference(), kOneVblank);
}

TEST(StepGroup, ALateFollowerDriftsInByOneVblankInFour) {
  SimulatedGroup group(2, {60, 1}, 5);
  group.at(seconds(2), [&group] { group.kill(1); });
  group.at(milliseconds(10'700), [&group] { group.start(1); });
  group.run_until(milliseconds(10'800));
  EXPECT_FALSE(group.player(1).in_step());
  // Half a loop of 90 frames takes 180 vblanks.
  group.run_until(seconds(15));
  expect_all_in_step(group, 2);
  EXPECT_EQ(group.went_back(), 0u);
  const StepPlace place = group.player(1).place();
  EXPECT_LE(place.repeated + place.dropped, kLoop / 2 + 3);
}

TEST(StepGroup, PlaysOnInStepWithoutItsLeader) {
  SimulatedGroup group(4, {60, 1}, 9);
  group.at(seconds(10), [&group] { group.kill(0); });
  group.run_until(seconds(300));
  for (size_t k = 1; k < 4; ++k) EXPECT_TRUE(group.player(k).in_step()) << k;
  EXPECT_EQ(group.player(1).member().peers(group.player(1).now(group.time())), 0u);
  EXPECT_LE(group.largest_difference(), kOneVblank);
}

TEST(StepGroup, AStepOfOneClockMovesNoFrame) {
  SimulatedGroup group(3, {60, 1}, 11);
  group.disturb_network(false);
  group.run_until(seconds(20));
  const uint64_t before = group.player(1).place().repeated + group.player(1).place().dropped;
  group.step_clock(0, seconds(2));
  group.step_clock(1, seconds(-2));
  group.run_until(seconds(40));
  expect_all_in_step(group, 3);
  EXPECT_LE(group.player(1).place().repeated + group.player(1).place().dropped, before + 1);
}

}  // namespace
}  // namespace lenticule::player
