// SPDX-License-Identifier: Apache-2.0
// Tests an output that is switched off and on while playing.
#include <cerrno>

#include "display/kms/scanout/kms_display.h"
#include "kms_stage.h"

namespace lenticule::test {
namespace {

using display::Verdict;

class KmsPower : public KmsStage {
 protected:
  void switch_off() {
    open();
    flip(1);
    ASSERT_TRUE(show->set_power(false));
    ASSERT_EQ(card.value(crtc, "ACTIVE"), 0U);
  }
};

TEST_F(KmsPower, AnOutputThatIsOffShowsNothingAndThenTheLastFrame) {
  switch_off();
  EXPECT_TRUE(show->statistics().off);
  EXPECT_TRUE(card.displayed(crtc).empty());
  EXPECT_EQ(submit(2), SubmitStatus::Paused);
  idle(seconds(60));
  EXPECT_EQ(card.value(crtc, "ACTIVE"), 0U);
  ASSERT_TRUE(show->set_power(true));
  expect_displayed(1);
  EXPECT_FALSE(show->statistics().off);
  EXPECT_EQ(show->statistics().modesets, 1U);
  flip(3);
  expect_displayed(3);
}

TEST_F(KmsPower, VblanksAreCountedByTimeWhileTheOutputIsOff) {
  open();
  const uint64_t before = flip(1).sequence;
  ASSERT_TRUE(show->set_power(false));
  const Nanoseconds begin = machine.now();
  uint64_t last = before;
  for (int k = 0; k < 60; ++k) {
    ASSERT_TRUE(show->request_vblank(last));
    const DisplayEvent tick = wait(seconds(1));
    ASSERT_EQ(tick.kind, EventKind::Vblank);
    EXPECT_GT(tick.sequence, last);
    last = tick.sequence;
  }
  EXPECT_NEAR(static_cast<double>(last - before),
              static_cast<double>((machine.now() - begin) / card.period), 2.0);
  EXPECT_EQ(show->statistics().lost_ticks, 0U);
  ASSERT_TRUE(show->set_power(true));
  EXPECT_GE(flip(2).sequence, last);
}

TEST_F(KmsPower, ExactnessIsAuditedAgainWhenTheOutputIsSwitchedOn) {
  switch_off();
  // Another program changes the look-up table, and the driver keeps the change.
  FakeProperty* const gamma = card.object(crtc).find("GAMMA_LUT");
  gamma->value = card.add_blob({1, 2, 3});
  gamma->ignores_writes = true;
  ASSERT_NE(show->exactness().verdict, Verdict::No);
  ASSERT_TRUE(show->set_power(true));
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  gamma->ignores_writes = false;
  ASSERT_TRUE(show->set_power(false));
  ASSERT_TRUE(show->set_power(true));
  EXPECT_EQ(card.value(crtc, "GAMMA_LUT"), 0U);
  EXPECT_NE(show->exactness().verdict, Verdict::No);
}

TEST_F(KmsPower, NothingButTheUserSwitchesTheOutputOn) {
  switch_off();
  card.object(crtc).find("GAMMA_LUT")->value = card.add_blob({1, 2, 3});
  idle(seconds(10));  // the audit would restore it by a modeset
  machine.sleep(seconds(3));
  idle(seconds(1));
  connector->connected = false;
  machine.announce_hotplug();
  idle(seconds(3));
  connector->connected = true;
  machine.announce_hotplug();
  idle(seconds(3));
  EXPECT_EQ(card.value(crtc, "ACTIVE"), 0U);
  ASSERT_TRUE(show->set_power(true));
  expect_displayed(1);
}

TEST_F(KmsPower, ARefusedSwitchOnIsTriedAgain) {
  switch_off();
  card.commit_faults = {{.error = EBUSY, .until = machine.now() + seconds(1)}};
  ASSERT_TRUE(show->set_power(true));
  EXPECT_EQ(card.value(crtc, "ACTIVE"), 0U);
  idle(seconds(4));
  expect_displayed(1);
}

TEST_F(KmsPower, ARefusedSwitchOffLeavesTheOutputOn) {
  open();
  flip(1);
  card.commit_faults = {{.error = EBUSY}};
  EXPECT_FALSE(show->set_power(false));
  flip(2);
  expect_displayed(2);
  EXPECT_TRUE(show->set_power(false));
}

TEST_F(KmsPower, TheNextPlayerLearnsThatTheOutputIsOff) {
  switch_off();
  EXPECT_EQ(show->takeover_state().off, 1U);
  ASSERT_TRUE(show->set_power(true));
  EXPECT_EQ(show->takeover_state().off, 0U);
}

}  // namespace
}  // namespace lenticule::test
