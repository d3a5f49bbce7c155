// SPDX-License-Identifier: Apache-2.0
// Tests panels that are plugged, unplugged, changed, or that report wrong data.
#include <cerrno>

#include "kms_stage.h"

namespace lenticule::test {

using display::PanelState;

class KmsHotplug : public KmsStage {
 protected:
  void replug(const std::vector<uint8_t>& edid) {
    connector->connected = false;
    machine.announce_hotplug();
    idle(seconds(1));
    EXPECT_EQ(show->statistics().panel, PanelState::Disconnected);
    connector->connected = true;
    card.set_edid(connector->id, edid);
    machine.announce_hotplug();
    idle(seconds(1));
  }
  /// Replugs the panel with this EDID; its own one can be read a second later.
  void expect_held_until_readable(const std::vector<uint8_t>& edid) {
    open();
    flip(1);
    replug(edid);
    EXPECT_EQ(show->statistics().panel, PanelState::Unreadable);
    EXPECT_EQ(show->statistics().modesets, 0U);
    flip(2);
    card.set_edid(connector->id, own_edid);
    idle(seconds(3));
    EXPECT_EQ(show->statistics().panel, PanelState::Showing);
    EXPECT_EQ(show->statistics().modesets, 1U);
    flip(3);
    expect_displayed(3);
  }
  const std::vector<uint8_t> own_edid = EdidMaker{.serial_text = "ONE"}.bytes();
};

TEST_F(KmsHotplug, PanelSwitchedOffAndOnGetsAModeset) {
  open();
  flip(1);
  replug(own_edid);
  EXPECT_EQ(show->statistics().panel, PanelState::Showing);
  EXPECT_EQ(show->statistics().modesets, 1U);
  expect_displayed(1);
  flip(2);
  expect_displayed(2);
}

TEST_F(KmsHotplug, StormOf100EventsCausesFewProbes) {
  open();
  flip(1);
  const int probes = card.full_probes;
  for (int i = 0; i < 100; ++i) {
    connector->connected = i % 2 == 1;
    machine.announce_hotplug();
    idle(milliseconds(5));
  }
  idle(seconds(1));
  EXPECT_LE(card.full_probes - probes, 6);
  EXPECT_EQ(show->statistics().panel, PanelState::Showing);
  flip(2);
  expect_displayed(2);
}

TEST_F(KmsHotplug, ChangeWithoutEventIsFoundByPolling) {
  open();
  connector->connected = false;
  idle(seconds(29));
  EXPECT_EQ(show->statistics().panel, PanelState::Showing);
  idle(seconds(3));
  EXPECT_EQ(show->statistics().panel, PanelState::Disconnected);
}

TEST_F(KmsHotplug, ChangedSerialIsAnotherPanelAndIsSwitchedOff) {
  open();
  flip(1);
  replug(EdidMaker{.serial_text = "TWO"}.bytes());
  EXPECT_EQ(show->statistics().panel, PanelState::WrongPanel);
  EXPECT_EQ(wait().kind, EventKind::Lost);
  EXPECT_TRUE(card.displayed(crtc).empty()) << "3-D for another panel must not stay on this one";
  EXPECT_THROW(show->reconnect(), Error);
}

TEST_F(KmsHotplug, AbsentEdidIsReadAgainUntilItIsComplete) { expect_held_until_readable({}); }

TEST_F(KmsHotplug, ShortEdidIsReadAgainUntilItIsComplete) {
  expect_held_until_readable({own_edid.begin(), own_edid.begin() + 40});
}

TEST_F(KmsHotplug, EdidWithABadChecksumIsReadAgainUntilItIsComplete) {
  auto damaged = own_edid;
  damaged[60] ^= 0xff;
  expect_held_until_readable(damaged);
}

TEST_F(KmsHotplug, PanelThatNoLongerListsItsModeKeepsIt) {
  const std::vector<std::vector<drmModeModeInfo>> lists = {
      {},
      {make_mode(kWidth / 2, kHeight / 2, 60)},
      // The panel would scale what it does not prefer.
      {make_mode(kWidth * 2, kHeight * 2, 60), make_mode(kWidth, kHeight, 60, false)}};
  const auto modes = connector->modes;
  for (const auto& list : lists) {
    open();
    flip(1);
    connector->modes = list;
    replug(own_edid);
    EXPECT_EQ(show->statistics().panel, PanelState::ModeMissing);
    EXPECT_EQ(show->statistics().modesets, 0U);
    flip(2);
    connector->modes = modes;
    idle(seconds(3));
    EXPECT_EQ(show->statistics().panel, PanelState::Showing);
    flip(3);
    expect_displayed(3);
    show.reset();
  }
}

TEST_F(KmsHotplug, BadLinkIsTrainedAgain) {
  open();
  flip(1);
  card.object(connector->id).find("link-status")->value = 1;
  machine.announce_hotplug();
  idle(seconds(1));
  EXPECT_EQ(card.value(connector->id, "link-status"), 0U);
  EXPECT_EQ(show->statistics().links_bad, 1U);
  expect_displayed(1);
}

TEST_F(KmsHotplug, ModesetThatIsRefusedBetweenFramesIsTriedAgain) {
  for (const int error : {EBUSY, EINVAL}) {
    open();
    flip(1);
    card.object(connector->id).find("link-status")->value = 1;
    card.commit_faults = {{.count = 3, .error = error}};
    machine.announce_hotplug();
    idle(seconds(2));
    EXPECT_EQ(card.value(connector->id, "link-status"), 0U) << "no frame had to come for that";
    EXPECT_EQ(show->statistics().recoveries, 1U);
    flip(2);
    expect_displayed(2);
    show.reset();
  }
}

TEST_F(KmsHotplug, FrameBetweenTwoAttemptsIsShownByTheModeset) {
  open();
  flip(1);
  card.object(connector->id).find("link-status")->value = 1;
  card.commit_faults = {{.error = EBUSY, .until = machine.now() + milliseconds(400)}};
  machine.announce_hotplug();
  idle(milliseconds(300));
  EXPECT_EQ(submit(2), SubmitStatus::Accepted);
  EXPECT_EQ(card.value(connector->id, "link-status"), 1U) << "a flip alone reaches no dead link";
  EXPECT_EQ(wait(seconds(2)).id, 2U);
  EXPECT_EQ(card.value(connector->id, "link-status"), 0U);
  expect_displayed(2);
}

TEST_F(KmsHotplug, ConnectorThatVanishesIsDisconnected) {
  open();
  flip(1);
  card.get_connector_faults = {{.error = ENOENT, .until = machine.now() + seconds(1)}};
  machine.announce_hotplug();
  idle(milliseconds(600));
  EXPECT_EQ(show->statistics().panel, PanelState::Disconnected);
  idle(seconds(40));
  EXPECT_EQ(show->statistics().panel, PanelState::Showing);
  flip(2);
}

TEST_F(KmsHotplug, AnyPanelOfTheRightSizeServesARigWithoutIdentity) {
  options.output.identity = {};
  open();
  flip(1);
  replug(EdidMaker{.serial_text = "TWO"}.bytes());
  EXPECT_EQ(show->statistics().panel, PanelState::Showing);
  flip(2);
  expect_displayed(2);
}

}  // namespace lenticule::test
