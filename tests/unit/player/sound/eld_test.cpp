// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "player/sound/sound_device.h"

namespace lenticule::player {
namespace {

constexpr PanelCode kPanel{0x1e, 0x6d, 0x34, 0x12};

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
  for (const std::string name : {"LG TV", ""}) {
    const auto panel = panel_of_eld(eld_of(name));
    ASSERT_TRUE(panel);
    EXPECT_EQ(panel->code, kPanel);
    EXPECT_EQ(panel->name, name);
  }
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

TEST(PanelSound, IsTheFirstDeviceWhoseEldIsThePanels) {
  const EldPanel other{.code = {1, 2, 3, 4}, .name = "other"}, own{.code = kPanel, .name = "LG TV"};
  const PanelSound sound = choose_sound(kPanel,
                                        {{"plughw:0,0", "PCH", std::nullopt},
                                         {"plughw:0,3", "PCH", other},
                                         {"plughw:2,8", "HDMI", own},
                                         {"plughw:2,9", "HDMI", own}},
                                        "sound card 1: Permission denied");
  EXPECT_EQ(sound.device, "plughw:2,8");
  EXPECT_EQ(sound.card, "HDMI");
  EXPECT_EQ(sound.monitor, "LG TV");
  EXPECT_EQ(sound.problem, "");
}

TEST(PanelSound, IsTheDefaultDeviceWithTheReason) {
  const std::vector<SoundOutput> outputs = {{"plughw:0,3", "PCH", std::nullopt}};
  const auto problem = [](const auto& panel, const auto& there, const std::string& unseen) {
    const PanelSound sound = choose_sound(panel, there, unseen);
    EXPECT_EQ(sound.device, "default");
    EXPECT_NE(sound.remedy, "");
    return sound.problem;
  };
  const std::optional<PanelCode> panel = kPanel, none;
  const std::vector<SoundOutput> no_outputs;
  EXPECT_EQ(problem(none, outputs, ""), "the panel has no EDID");
  EXPECT_EQ(problem(panel, no_outputs, ""), "the machine has no sound card");
  EXPECT_EQ(problem(panel, outputs, ""),
            "no sound card says that one of its outputs has this panel (ELD)");
  EXPECT_EQ(problem(panel, outputs, "sound card 1: denied"), "sound card 1: denied");
}

}  // namespace
}  // namespace lenticule::player
