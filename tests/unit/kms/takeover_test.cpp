// SPDX-License-Identifier: Apache-2.0
// Tests that after a player's death the next one takes over card, picture and buffers without a
// modeset.
#include "kms_stage.h"

namespace lenticule::test {

using display::TakeoverState;

class Takeover : public KmsStage {};

TEST_F(Takeover, LastFrameStaysAndTheNextPlayerNeedsNoModeset) {
  options.previous = die_after(1);
  expect_displayed(1);
  open();
  expect_displayed(1);
  EXPECT_TRUE(show->took_over());
  EXPECT_EQ(card.modesets, 0);
  EXPECT_EQ(card.buffers.size(), 3U);
  flip(2);
  expect_displayed(2);
  flip(3);
  expect_displayed(3);
  EXPECT_EQ(card.modesets, 0);
}

class TakeoverOfTenBits : public KmsStage {
 protected:
  TakeoverOfTenBits() {
    card.set_edid(connector->id, EdidMaker{.serial_text = "ONE", .deep_colour = true}.bytes());
    card.formats = {DRM_FORMAT_XRGB8888, DRM_FORMAT_XRGB2101010};
    options.output.depth = display::ScanoutDepth::Bits10;
    options.previous = die_after(1);
  }
};

TEST_F(TakeoverOfTenBits, NeedsNoModeset) {
  EXPECT_EQ(options.previous->state.bits, 10U);
  open();
  EXPECT_TRUE(show->took_over());
  EXPECT_EQ(card.modesets, 0);
  flip(2);
  EXPECT_EQ(card.modesets, 0);
}

TEST_F(TakeoverOfTenBits, ByARigOfEightBitsFreesTheOldBuffers) {
  options.output.depth = display::ScanoutDepth::Bits8;
  open();
  flip(2);
  expect_displayed(2);
  EXPECT_EQ(card.buffers.size(), 3U);
}

TEST_F(Takeover, EventForTheDeadPlayerIsIgnored) {
  auto left = die_after(1);
  card.schedule_flip_event(crtc, 4711);
  machine.advance_to(machine.now() + seconds(1));
  options.previous = left;
  open();
  flip(2);
  EXPECT_EQ(show->statistics().stray_events, 0U) << "drained before it could be mistaken";
}

TEST_F(Takeover, OutdatedStateIsNotUsed) {
  const auto spoil = std::vector<std::function<void(TakeoverState&)>>{
      [](TakeoverState& state) { state.connector = 9999; },
      [](TakeoverState& state) { state.plane = 9999; },
      [](TakeoverState& state) { state.width = kWidth * 2; },
      [](TakeoverState& state) { state.edid_sha256[0] ^= 1; },
      [](TakeoverState& state) { state.buffers[1].handle = 9999; }};
  for (const auto& spoiled : spoil) {
    options.previous = die_after(1);
    spoiled(options.previous->state);
    open();
    flip(2);
    expect_displayed(2);
    show.reset();
    while (!card.ends.empty()) card.closed(card.ends.begin()->first);
    card.buffers.clear();
    card.framebuffers.clear();
  }
}

TEST_F(Takeover, AFreshStartUsesTheCardButNotTheOldBuffers) {
  options.previous = die_after(1);
  options.fresh = true;
  open();
  EXPECT_FALSE(show->took_over());
  EXPECT_EQ(card.modesets, 1);
  EXPECT_EQ(card.buffers.size(), 3U);
  EXPECT_EQ(card.displayed(crtc), std::vector<uint32_t>(size_t{kWidth} * kHeight, 0));
  flip(2);
  expect_displayed(2);
}

TEST_F(Takeover, DescriptorThatIsNotACardIsNotUsed) {
  options.previous = std::make_shared<display::PreviousOutput>();
  options.previous->card = UniqueFd(::open("/dev/null", O_RDWR | O_CLOEXEC));
  open();
  flip(1);
  expect_displayed(1);
}

TEST_F(Takeover, StateSurvivesSerialization) {
  open();
  const TakeoverState state = show->takeover_state();
  const auto bytes = display::bytes_of(state);
  EXPECT_EQ(display::parse_takeover_state(bytes), state);
  EXPECT_EQ(display::parse_takeover_state(bytes.first(bytes.size() - 1)), std::nullopt);
}

TEST_F(Takeover, ImplausibleBytesAreRejected) {
  open();
  const TakeoverState good = show->takeover_state();
  const auto rejected = [&](auto change) {
    TakeoverState state = good;
    change(state);
    return !display::parse_takeover_state(display::bytes_of(state)).has_value();
  };
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.magic ^= 1; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.version = 1; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.bits = 12; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.buffer_count = 5; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.buffer_count = 0; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.width = -1; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.buffers[0].pitch = 4; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.buffers[0].size = 1; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.buffers[0].size = ~uint64_t{0}; }));
  EXPECT_TRUE(rejected([](TakeoverState& s) { s.card.fill('x'); }));
}

}  // namespace lenticule::test
