// SPDX-License-Identifier: Apache-2.0
// Tests the search for a panel without opening it, also while a display of ours is active.
#include <gmock/gmock.h>

#include "display/kms/inspect.h"
#include "kms_stage.h"

namespace lenticule::test {

using display::PanelSearch;
using ::testing::HasSubstr;

class PanelSearchTest : public KmsStage {
 protected:
  [[nodiscard]] PanelSearch search() const { return display::search_panel(options, show.get()); }
  FakeConnector& add_panel(uint32_t type_id, const std::string& serial) {
    return card.add_connector(DRM_MODE_CONNECTOR_HDMIA, type_id, make_mode(kWidth, kHeight, 60),
                              EdidMaker{.serial_text = serial}.bytes());
  }
};

TEST_F(PanelSearchTest, FindsThePanelThatOpeningWouldUseWithoutBecomingMaster) {
  EXPECT_TRUE(search().found);
  EXPECT_EQ(card.master_fd, -1);
  EXPECT_EQ(card.tests + card.modesets + card.blocking_commits, 0);
}

TEST_F(PanelSearchTest, ListsPresentPanelsAndReportsThatThePanelMayCome) {
  add_panel(9, "ANOTHER");
  add_panel(2, "OFF").connected = false;
  options.output.identity.serial = "EXPECTED";
  const PanelSearch result = search();
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(result.may_come);
  EXPECT_EQ(result.refusal.kind(), ErrorKind::Input);
  EXPECT_THAT(result.refusal.what(), HasSubstr("serial EXPECTED"));
  ASSERT_EQ(result.present.size(), 2U);
  EXPECT_EQ(result.present[0].connector, "HDMI-A-1");
  EXPECT_EQ(result.present[0].identity->serial_text, "ONE");
  EXPECT_EQ(result.present[1].connector, "HDMI-A-9");
}

TEST_F(PanelSearchTest, ProbesOnlyANamedOutput) {
  add_panel(2, "TWO");
  options.output.identity.serial = "EXPECTED";
  options.output.connector = "HDMI-A-2";
  const PanelSearch result = search();
  ASSERT_EQ(result.present.size(), 1U);
  EXPECT_EQ(result.present[0].identity->serial_text, "TWO");
}

TEST_F(PanelSearchTest, AnEdidKeyDoesNotRestrictTheConnector) {
  options.output.identity = {};
  options.output = display::parse_output("edid:LGD:0x1234:EXPECTED", options.output);
  EXPECT_EQ(search().present.size(), 1U) << "the panel that hangs there instead";
}

TEST_F(PanelSearchTest, WaitingDoesNotResolveTwoMatches) {
  add_panel(2, "TWO");
  options.output.identity = {};
  const PanelSearch result = search();
  EXPECT_FALSE(result.found);
  EXPECT_FALSE(result.may_come);
}

TEST_F(PanelSearchTest, APanelWithoutTheModeIsNotFoundAndMayCome) {
  connector->modes = {make_mode(kWidth * 2, kHeight * 2, 60)};
  const PanelSearch result = search();
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(result.may_come);
  EXPECT_THAT(result.refusal.what(), HasSubstr("48x12"));
  ASSERT_EQ(result.present.size(), 1U);
  EXPECT_TRUE(result.present[0].modes[0].preferred);
}

TEST_F(PanelSearchTest, ProbesAnActiveDisplaysCardThroughThatDisplay) {
  open();
  flip(1);
  const size_t ends = card.ends.size();
  EXPECT_TRUE(search().found);
  EXPECT_EQ(card.ends.size(), ends);
  card.set_edid(connector->id, EdidMaker{.serial_text = "TWO"}.bytes());
  EXPECT_FALSE(search().found);
  flip(2);
  expect_displayed(2);
}

}  // namespace lenticule::test
