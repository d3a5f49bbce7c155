// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/panel_monitor.h"

#include <gtest/gtest.h>

#include "tests/support/fakes/fake_drm.h"

namespace lenticule::test {

using display::ConnectorInfo;
using display::evaluate_panel;
using display::OutputRequest;
using display::PanelState;

class PanelEvaluation : public ::testing::Test {
 protected:
  static ConnectorInfo panel_with(const std::vector<uint8_t>& edid) {
    return {.connected = true, .modes = {make_mode(64, 32, 60)}, .edid = display::read_edid(edid)};
  }
  [[nodiscard]] PanelState state_of(const ConnectorInfo& panel) const {
    return evaluate_panel(panel, request, 0, make_mode(64, 32, 60));
  }

  OutputRequest request{
      .identity = {.manufacturer = "LGD", .product = {}, .serial = "ONE", .edid_sha256 = {}},
      .panel = {64, 32, frames::PixelFormat::Rgb8}};
  const std::vector<uint8_t> own = EdidMaker{.serial_text = "ONE"}.bytes();
};

TEST_F(PanelEvaluation, AcceptsTheRequestedPanel) {
  EXPECT_EQ(state_of(panel_with(own)), PanelState::Showing);
}

TEST_F(PanelEvaluation, ReportsAMissingPanelAsDisconnected) {
  ConnectorInfo panel = panel_with(own);
  panel.connected = false;
  EXPECT_EQ(state_of(panel), PanelState::Disconnected);
}

TEST_F(PanelEvaluation, ReportsWrongAndUnreadablePanelsUnlessIdentityIsIgnored) {
  EXPECT_EQ(state_of(panel_with(EdidMaker{.serial_text = "TWO"}.bytes())), PanelState::WrongPanel);
  EXPECT_EQ(state_of(panel_with({})), PanelState::Unreadable);
  request.policy = display::IdentityPolicy::Ignore;
  EXPECT_EQ(state_of(panel_with(EdidMaker{.serial_text = "TWO"}.bytes())), PanelState::Showing);
  EXPECT_EQ(state_of(panel_with({})), PanelState::Showing);
}

TEST_F(PanelEvaluation, ReportsAModeThatIsGoneOrWouldBeScaled) {
  ConnectorInfo panel = panel_with(own);
  panel.modes = {make_mode(64, 32, 50)};
  EXPECT_EQ(state_of(panel), PanelState::ModeMissing);
  panel.modes = {make_mode(128, 64, 60), make_mode(64, 32, 60, false)};
  EXPECT_EQ(state_of(panel), PanelState::ModeMissing);
}

}  // namespace lenticule::test
