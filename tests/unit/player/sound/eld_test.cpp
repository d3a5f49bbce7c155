// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "player/sound/sound_device.h"

namespace lenticule::player {
namespace {

/// Returns the ELD of a panel, as the HDA specification lays it out.
std::vector<uint8_t> eld_of(const std::string& name) {
  std::vector<uint8_t> bytes(20, 0);
  bytes[0] = 2 << 3;  // version
  bytes[2] = static_cast<uint8_t>((16 + name.size() + 3 + 3) / 4);
  bytes[4] = static_cast<uint8_t>(name.size());
  bytes[5] = 1 << 4;  // one short audio descriptor
  bytes[16] = 0x1e;   // GSM
  bytes[17] = 0x6d;
  bytes[18] = 0x34;
  bytes[19] = 0x12;
  bytes.insert(bytes.end(), name.begin(), name.end());
  bytes.insert(bytes.end(), {0x09, 0x7f, 0x07, 0, 0, 0});
  return bytes;
}

TEST(Eld, NamesThePanelAsItsEdidDoes) {
  EXPECT_EQ(panel_of_eld(eld_of("LG TV")), (PanelCode{0x1e, 0x6d, 0x34, 0x12}));
  EXPECT_EQ(panel_of_eld(eld_of("")), (PanelCode{0x1e, 0x6d, 0x34, 0x12}));
}

TEST(Eld, IsNoneWithoutAPanel) {
  EXPECT_FALSE(panel_of_eld({}));
  EXPECT_FALSE(panel_of_eld(std::vector<uint8_t>(84, 0)));
  std::vector<uint8_t> longer = eld_of("LG TV");
  longer[4] = 31;
  EXPECT_FALSE(panel_of_eld(longer)) << "a name may have 16 bytes";
  longer = eld_of("LG TV");
  longer[2] = 2;
  EXPECT_FALSE(panel_of_eld(longer)) << "the name is not within its length";
}

TEST(Eld, ACutOneIsNoneOrStillThePanels) {
  std::vector<uint8_t> bytes = eld_of("A panel's name");
  while (!bytes.empty()) {
    bytes.pop_back();
    const auto panel = panel_of_eld(bytes);
    EXPECT_EQ(panel.has_value(), bytes.size() >= 20 + 14) << bytes.size();
  }
}

}  // namespace
}  // namespace lenticule::player
