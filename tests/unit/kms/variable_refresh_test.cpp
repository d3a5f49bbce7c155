// SPDX-License-Identifier: Apache-2.0
// Tests that the refresh of a panel which can vary it is held at the mode's rate while frames are
// shown, and left as before at the end.
#include <gmock/gmock.h>

#include <algorithm>

#include "display/kms/inspect.h"
#include "kms_stage.h"

namespace lenticule::test {

using display::AuditOutcome;
using display::AuditRow;
using display::Verdict;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

class VariableRefresh : public KmsStage {
 protected:
  VariableRefresh() {
    connector->type = DRM_MODE_CONNECTOR_VIRTUAL;
    card.driver = "virtio_gpu";
    card.add_property(connector->id, {.name = "vrr_capable",
                                      .flags = DRM_MODE_PROP_RANGE | DRM_MODE_PROP_IMMUTABLE,
                                      .value = 1,
                                      .maximum = 1});
    card.add_property(
        crtc, {.name = "VRR_ENABLED", .flags = DRM_MODE_PROP_RANGE, .value = 1, .maximum = 1});
  }
  FakeProperty& enabled() { return *card.object(crtc).find("VRR_ENABLED"); }
  [[nodiscard]] AuditRow row() const {
    const auto rows = show->exactness().rows;
    const auto found = std::ranges::find(rows, "VRR_ENABLED", &AuditRow::property);
    EXPECT_NE(found, rows.end());
    return found == rows.end() ? AuditRow{} : *found;
  }
};

TEST_F(VariableRefresh, IsOffWhileFramesAreShownAndRestoredAfterwards) {
  card.show_console(connector->id, crtc);
  open();
  EXPECT_EQ(enabled().value, 0U);
  EXPECT_EQ(row().outcome, AuditOutcome::Forced);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  EXPECT_THAT(show->exactness().verified, Contains(HasSubstr("held at the rate of the mode")));
  show.reset();
  EXPECT_EQ(enabled().value, 1U);
}

TEST_F(VariableRefresh, IsSwitchedOffInTheCommitThatSetsTheMode) {
  enabled().needs_modeset = true;
  open();
  EXPECT_EQ(enabled().value, 0U);
  EXPECT_EQ(card.modesets, 1);
  EXPECT_EQ(card.blocking_commits, 0);
}

TEST_F(VariableRefresh, IsSwitchedOffAgainIfAnotherProgramSwitchesItOn) {
  open();
  flip(1);
  enabled().value = 1;
  idle(seconds(4));
  EXPECT_EQ(enabled().value, 0U);
  EXPECT_EQ(show->statistics().modesets, 1U);
}

TEST_F(VariableRefresh, ThatTheDriverDoesNotSwitchOffIsARemarkWithARemedy) {
  enabled().ignores_writes = true;
  open();
  EXPECT_EQ(row().outcome, AuditOutcome::Refused);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes) << "it changes no subpixel";
  EXPECT_THAT(show->exactness().remarks, Contains(HasSubstr("'VRR_ENABLED' is 1: vblanks")));
  EXPECT_THAT(show->exactness().remedies, Contains(HasSubstr("panel's menu")));
  EXPECT_THAT(show->exactness().verified, Not(Contains(HasSubstr("held at the rate"))));
}

TEST_F(VariableRefresh, IsNotMentionedForAPanelWithoutIt) {
  card.object(connector->id).find("vrr_capable")->value = 0;
  open();
  EXPECT_EQ(enabled().value, 0U);
  EXPECT_THAT(show->exactness().verified, Not(Contains(HasSubstr("held at the rate"))));
}

TEST_F(VariableRefresh, DoctorSaysThatItWouldBeHeldAndChangesNothing) {
  const auto found = display::diagnose(machine.session(), {}, machine.platform());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].panel.variable_refresh);
  EXPECT_THAT(found[0].exactness.verified, Contains(HasSubstr("held at the rate of the mode")));
  EXPECT_EQ(enabled().value, 1U);
}

}  // namespace lenticule::test
