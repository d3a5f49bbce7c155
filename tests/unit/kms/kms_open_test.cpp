// SPDX-License-Identifier: Apache-2.0
// Tests the search for the requested panel, and every failure before the first picture.
#include <gmock/gmock.h>

#include <cerrno>

#include "base/error.h"
#include "display/kms/inspect.h"
#include "kms_stage.h"
#include "tests/support/error_matchers.h"

namespace lenticule::test {

using ::testing::HasSubstr;

class KmsOpen : public KmsStage {
 protected:
  FakeConnector& add_panel(uint32_t type_id, const std::string& serial) {
    FakeConnector& added =
        card.add_connector(DRM_MODE_CONNECTOR_HDMIA, type_id, make_mode(kWidth, kHeight, 60),
                           EdidMaker{.serial_text = serial}.bytes());
    card.add_crtc();
    added.possible_crtcs = 3;
    return added;
  }
};

TEST_F(KmsOpen, ThreeConnectorsInTheWrongOrderStillShowTheRigsPanel) {
  add_panel(2, "TWO");
  FakeConnector& third = add_panel(3, "THREE");
  options.output.identity.serial = "THREE";
  open();
  EXPECT_NE(card.value(third.id, "CRTC_ID"), 0U);
  EXPECT_EQ(card.value(connector->id, "CRTC_ID"), 0U);
}

TEST_F(KmsOpen, TwoMatchingPanelsAreAnErrorThatListsThem) {
  add_panel(2, "TWO");
  options.output.identity = {};
  expect_error(failure(), ErrorKind::Device, "HDMI-A-1", "HDMI-A-2");
}

TEST_F(KmsOpen, AnotherPanelThanTheRigsIsRefused) {
  options.output.identity.serial = "OTHER";
  expect_error(failure(), ErrorKind::Input, "serial ONE", "serial OTHER");
}

TEST_F(KmsOpen, AnotherPanelMayShowATestCard) {
  options.output.identity.serial = "OTHER";
  options.output.policy = display::IdentityPolicy::Ignore;
  open();
  flip(1);
}

TEST_F(KmsOpen, AFreshStartSetsTheModeAlthoughItRuns) {
  card.show_console(connector->id, crtc);
  options.fresh = true;
  open();
  EXPECT_FALSE(show->took_over());
  EXPECT_EQ(card.modesets, 1);
  flip(1);
  expect_displayed(1);
}

TEST_F(KmsOpen, PanelNamedByEdidIsFound) {
  FakeConnector& second = add_panel(2, "TWO");
  options.output.identity = {};
  options.output = display::parse_output("edid:LGD:0x1234:TWO", options.output);
  open();
  EXPECT_NE(card.value(second.id, "CRTC_ID"), 0U);
}

TEST_F(KmsOpen, ConnectorOnAnotherCardIsFound) {
  FakeCard& other = machine.add_card("/dev/dri/card1", "other");
  const uint32_t crtc_there = other.add_crtc();
  other.add_connector(DRM_MODE_CONNECTOR_DisplayPort, 1, make_mode(kWidth, kHeight, 60),
                      EdidMaker{.serial_text = "FAR"}.bytes());
  options.output.identity.serial = "FAR";
  open();
  EXPECT_EQ(other.value(crtc_there, "ACTIVE"), 1U);
  EXPECT_EQ(card.master_fd, -1) << "the card that was only looked at is not kept";
}

TEST_F(KmsOpen, UnreadableEdidNeverMatchesTheRigsPanel) {
  const auto own = EdidMaker{.serial_text = "ONE"}.bytes();
  auto damaged = own;
  damaged[60] ^= 0xff;
  const std::vector<std::pair<std::vector<uint8_t>, const char*>> cases = {
      {{}, "EDID absent"},
      {{own.begin(), own.begin() + 127}, "EDID too short"},
      {damaged, "EDID wrong checksum"}};
  for (const auto& [edid, text] : cases) {
    card.set_edid(connector->id, edid);
    expect_error(failure(), ErrorKind::Input, text);
  }
}

TEST_F(KmsOpen, CardWithoutPermissionIsNamed) {
  card.forbidden = true;
  const Error error = failure();
  EXPECT_EQ(error.kind(), ErrorKind::Device);
  EXPECT_STREQ(error.what(), "/dev/dri/card0: Permission denied");
  const display::Inspection found = display::inspect_cards(options.session);
  ASSERT_EQ(found.cards.size(), 1U);
  EXPECT_THAT(found.cards[0].problem, HasSubstr("Permission denied"));
}

TEST_F(KmsOpen, ForeignMasterIsOneClearError) {
  card.foreign_master = true;
  expect_error(failure(), ErrorKind::Device, "cannot become DRM master");
  EXPECT_EQ(card.buffers.size(), 0U);
}

TEST_F(KmsOpen, NoSpaceAtTheTestIsAnErrorNotASmallerMode) {
  connector->modes.push_back(make_mode(kWidth / 2, kHeight / 2, 60, false));
  card.test_faults = {{.count = 100, .error = ENOSPC}};
  expect_error(failure(), ErrorKind::Device, "bandwidth");
  EXPECT_EQ(card.modesets, 0);
  EXPECT_EQ(card.buffers.size(), 0U);
}

TEST_F(KmsOpen, FailureAfterTheModesetRestoresThePreviousPicture) {
  card.show_console(connector->id, crtc);
  const auto before = card.displayed(crtc);
  machine.no_hotplug_monitor = true;
  EXPECT_EQ(failure().kind(), ErrorKind::Failed);
  EXPECT_EQ(card.displayed(crtc), before);
  EXPECT_EQ(card.rmfb_on_screen, 0);
  EXPECT_EQ(card.master_fd, -1);
  machine.no_hotplug_monitor = false;
  open();
  flip(1);
}

TEST_F(KmsOpen, BusyModesetIsTriedAgain) {
  card.commit_faults = {{.count = 3, .error = EBUSY}};
  open();
  flip(1);
}

TEST_F(KmsOpen, PanelWithoutTheRigsSizeIsRefusedWithItsModes) {
  connector->modes = {make_mode(kWidth * 2, kHeight * 2, 60)};
  expect_error(failure(), ErrorKind::Input, "48x12@59.8");
}

TEST_F(KmsOpen, PanelThatWouldScaleIsRefusedThoughItListsTheSize) {
  connector->modes = {make_mode(kWidth * 2, kHeight * 2, 60),
                      make_mode(kWidth, kHeight, 60, false)};
  const Error error = failure();
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), HasSubstr("HDMI-A-1: the panel would scale 24x6 to its own 48x12"));
  EXPECT_FALSE(error.hint().empty());
  EXPECT_EQ(card.modesets + card.blocking_commits + card.flips, 0);
  const display::Inspection found = display::inspect_cards(options.session);
  ASSERT_EQ(found.panels[0].modes.size(), 2U);
  EXPECT_TRUE(found.panels[0].modes[0].native);
  EXPECT_FALSE(found.panels[0].modes[1].native);
}

TEST_F(KmsOpen, PrefersThePanelWhoseNativeSizeFits) {
  FakeConnector& second = add_panel(2, "TWO");
  connector->modes = {make_mode(kWidth * 2, kHeight * 2, 60),
                      make_mode(kWidth, kHeight, 60, false)};
  options.output.identity = {};
  open();
  EXPECT_NE(card.value(second.id, "CRTC_ID"), 0U);
}

TEST_F(KmsOpen, APanelWhoseTilesAreUnknownIsRefused) {
  card.add_property(connector->id, {.name = "TILE",
                                    .flags = DRM_MODE_PROP_BLOB | DRM_MODE_PROP_IMMUTABLE,
                                    .value = card.add_blob({1})});
  EXPECT_THAT(failure().what(), HasSubstr("tiles are not known"));
}

TEST_F(KmsOpen, HeadsetIsSkippedUnlessNamed) {
  card.object(connector->id).find("non-desktop")->value = 1;
  EXPECT_EQ(failure().kind(), ErrorKind::Device);
  options.output.connector = "HDMI-A-1";
  open();
}

TEST_F(KmsOpen, NamesWhatIsMissing) {
  connector->connected = false;
  EXPECT_THAT(failure().what(), HasSubstr("no panel is connected"));
  connector->connected = true;
  connector->modes.clear();
  EXPECT_THAT(failure().what(), HasSubstr("it has none"));
  card.atomic = false;
  EXPECT_THAT(failure().what(), HasSubstr("atomic modesetting"));
  card.gone = true;
  EXPECT_THAT(failure().what(), HasSubstr("no graphics card has an output"));
}

TEST_F(KmsOpen, MemoryThatFailsAtAnyPlaceLeaksNothing) {
  const std::vector<std::function<void(int)>> faults = {
      [&](int n) { card.create_faults = {{.skip = n, .error = ENOMEM}}; },
      [&](int n) { card.map_faults = {{.skip = n, .error = EINVAL}}; },
      [&](int n) { machine.fail_maps(n, 1); }};
  for (const auto& fail : faults)
    for (int n = 0; n < 3; ++n) {
      fail(n);
      if (n < 2) {
        EXPECT_EQ(failure().kind(), ErrorKind::Failed);
      } else {  // two buffers are enough
        open();
        flip(1);
        show.reset();
      }
      EXPECT_EQ(card.buffers.size() + card.framebuffers.size(), 0U);
      EXPECT_EQ(machine.mappings_alive, 0);
    }
}

TEST_F(KmsOpen, LittleMemoryMeansFewerBuffers) {
  card.max_buffers = 2;
  options.buffers = 4;
  open();
  flip(1);
  flip(2);
  expect_displayed(2);
}

TEST_F(KmsOpen, ConnectorVanishingBetweenTwoCallsIsAnError) {
  for (int calls = 0; calls < 4; ++calls) {
    card.get_connector_faults = {{.skip = calls, .count = 1000, .error = ENOENT}};
    try {
      open();
      flip(1);
      show.reset();
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Device);
    }
    EXPECT_EQ(card.buffers.size(), 0U);
  }
}

TEST_F(KmsOpen, MissingPropertyIsAnErrorNotPropertyZero) {
  auto& properties = card.object(card.primary_of(crtc)).properties;
  std::erase_if(properties, [](const FakeProperty& p) { return p.name == "SRC_W"; });
  EXPECT_THAT(failure().what(), HasSubstr("no property 'SRC_W'"));
}

TEST_F(KmsOpen, InspectionFindsPanelsAndGivesMastershipBack) {
  const display::Inspection found = display::inspect_cards(options.session);
  ASSERT_EQ(found.cards.size(), 1U);
  EXPECT_EQ(found.cards[0].driver, "fake");
  EXPECT_TRUE(found.cards[0].master);
  ASSERT_EQ(found.panels.size(), 1U);
  EXPECT_EQ(found.panels[0].identity->serial_text, "ONE");
  ASSERT_EQ(found.panels[0].modes.size(), 1U);
  EXPECT_TRUE(found.panels[0].modes[0].usable);
  EXPECT_EQ(card.master_fd, -1);
  EXPECT_EQ(card.modesets + card.blocking_commits + card.flips, 0);
}

TEST_F(KmsOpen, DiagnosisTestsThePanelsOwnModeAndChangesNothing) {
  connector->modes = {make_mode(kWidth, kHeight, 60, false),
                      make_mode(kWidth * 2, kHeight * 2, 60)};
  const auto diagnoses = display::diagnose(options.session, {}, options.platform);
  ASSERT_EQ(diagnoses.size(), 1U);
  EXPECT_EQ(diagnoses[0].problem, "");
  EXPECT_TRUE(diagnoses[0].tested);
  EXPECT_EQ(diagnoses[0].exactness.verdict, display::Verdict::Unknown);
  EXPECT_GT(card.tests, 0);
  EXPECT_EQ(card.modesets + card.blocking_commits + card.flips, 0);
  EXPECT_EQ(card.buffers.size() + card.framebuffers.size(), 0U);
  EXPECT_EQ(machine.mappings_alive, 0);
  EXPECT_EQ(card.master_fd, -1);
}

TEST_F(KmsOpen, DiagnosisNamesTheRefusedRequest) {
  card.test_faults = {{.count = 1000, .error = ENOSPC}};
  const auto diagnoses = display::diagnose(options.session, {}, options.platform);
  ASSERT_EQ(diagnoses.size(), 1U);
  EXPECT_THAT(diagnoses[0].problem, HasSubstr("refuses its mode"));
  EXPECT_FALSE(diagnoses[0].remedy.empty());
}

TEST_F(KmsOpen, DiagnosisSaysThatAnotherProgramIsMaster) {
  card.foreign_master = true;
  const auto diagnoses = display::diagnose(options.session, {}, options.platform);
  ASSERT_EQ(diagnoses.size(), 1U);
  EXPECT_FALSE(diagnoses[0].tested);
  EXPECT_THAT(diagnoses[0].problem, HasSubstr("master"));
}

}  // namespace lenticule::test
