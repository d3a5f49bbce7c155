// SPDX-License-Identifier: Apache-2.0
// Tests that after a player's death the next one takes over card, picture and buffers without a
// modeset.
#include <fcntl.h>

#include "kms_stage.h"

namespace lenticule::testing {

using display::HandoverState;

class Handover : public KmsStage {
 protected:
  /// Plays one frame, then dies; returns the state for the next player.
  std::shared_ptr<display::InheritedOutput> die_after(unsigned seed) {
    options.exit = display::ExitPolicy::Hold;
    open();
    flip(seed);
    auto left = std::make_shared<display::InheritedOutput>();
    left->state = show->handover();
    // The same open file has another number, as in systemd's descriptor store.
    const int old_fd = show->card_fd();
    left->card = UniqueFd(fcntl(old_fd, F_DUPFD_CLOEXEC, 0));
    const int ours = card.ends.at(old_fd);
    card.ends.erase(old_fd);
    card.ends[left->card.get()] = ours;
    card.master_fd = left->card.get();
    show.reset();
    card.modesets = card.blocking_commits = 0;
    return left;
  }
};

TEST_F(Handover, LastFrameStaysAndTheNextPlayerNeedsNoModeset) {
  options.inherited = die_after(1);
  expect_on_glass(1);
  open();
  expect_on_glass(1);
  EXPECT_TRUE(show->took_over());
  EXPECT_EQ(card.modesets, 0);
  EXPECT_EQ(card.buffers.size(), 3U);
  flip(2);
  expect_on_glass(2);
  flip(3);
  expect_on_glass(3);
  EXPECT_EQ(card.modesets, 0);
}

TEST_F(Handover, FiftyDeathsLeakNoBuffer) {
  for (unsigned i = 0; i < 50; ++i) {
    options.inherited = die_after(i);
    open();
    EXPECT_EQ(card.buffers.size(), 3U);
    EXPECT_EQ(card.framebuffers.size(), 3U);
    EXPECT_EQ(card.modesets, 0);
    options.exit = display::ExitPolicy::Restore;
    // The next iteration opens the card itself.
    show.reset();
    while (!card.ends.empty()) card.closed(card.ends.begin()->first);
    card.buffers.clear();
    card.framebuffers.clear();
  }
}

TEST_F(Handover, EventForTheDeadPlayerIsIgnored) {
  auto left = die_after(1);
  card.schedule_flip_event(crtc, 4711);
  machine.advance_to(machine.now() + seconds(1));
  options.inherited = left;
  open();
  flip(2);
  EXPECT_EQ(show->statistics().stray_events, 0U) << "drained before it could be mistaken";
}

TEST_F(Handover, OutdatedStateIsNotUsed) {
  const auto spoil = std::vector<std::function<void(HandoverState&)>>{
      [](HandoverState& state) { state.connector = 9999; },
      [](HandoverState& state) { state.plane = 9999; },
      [](HandoverState& state) { state.width = kWidth * 2; },
      [](HandoverState& state) { state.edid_sha256[0] ^= 1; },
      [](HandoverState& state) { state.buffers[1].handle = 9999; }};
  for (const auto& spoiled : spoil) {
    options.inherited = die_after(1);
    spoiled(options.inherited->state);
    open();
    flip(2);
    expect_on_glass(2);
    show.reset();
    while (!card.ends.empty()) card.closed(card.ends.begin()->first);
    card.buffers.clear();
    card.framebuffers.clear();
  }
}

TEST_F(Handover, AFreshStartUsesTheCardButNotTheOldBuffers) {
  options.inherited = die_after(1);
  options.fresh = true;
  open();
  EXPECT_FALSE(show->took_over());
  EXPECT_EQ(card.modesets, 1);
  EXPECT_EQ(card.buffers.size(), 3U);
  EXPECT_EQ(card.glass(crtc), std::vector<uint32_t>(size_t{kWidth} * kHeight, 0));
  flip(2);
  expect_on_glass(2);
}

TEST_F(Handover, DescriptorThatIsNotACardIsNotUsed) {
  options.inherited = std::make_shared<display::InheritedOutput>();
  options.inherited->card = UniqueFd(::open("/dev/null", O_RDWR | O_CLOEXEC));
  open();
  flip(1);
  expect_on_glass(1);
}

TEST_F(Handover, StateSurvivesSerialization) {
  open();
  const HandoverState state = show->handover();
  const auto bytes = display::handover_bytes(state);
  EXPECT_EQ(display::parse_handover(bytes), state);
  EXPECT_EQ(display::parse_handover(bytes.first(bytes.size() - 1)), std::nullopt);
}

TEST_F(Handover, ImplausibleBytesAreRejected) {
  open();
  const HandoverState good = show->handover();
  const auto rejected = [&](auto change) {
    HandoverState state = good;
    change(state);
    return !display::parse_handover(display::handover_bytes(state)).has_value();
  };
  EXPECT_TRUE(rejected([](HandoverState& s) { s.magic ^= 1; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.version = 2; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.buffer_count = 5; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.buffer_count = 0; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.width = -1; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.buffers[0].pitch = 4; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.buffers[0].size = 1; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.buffers[0].size = ~uint64_t{0}; }));
  EXPECT_TRUE(rejected([](HandoverState& s) { s.card.fill('x'); }));
}

}  // namespace lenticule::testing
