// SPDX-License-Identifier: Apache-2.0
// Tests a rig that cannot be read, so that the panel it asks for is unknown.

#include <filesystem>

#include "display/test_card.h"
#include "player/session/panel_card.h"
#include "player/session/play_plan.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/kms/kms_stage.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

class RigError : public test::KmsStage {
 protected:
  test::ScratchFolder scratch;
  fs::path folder = scratch.path();
  PlayFlags flags;
  ServiceManager manager;
  void SetUp() override {
    flags.source = "film.png";
    flags.rig = folder / "lobby.toml";
    flags.display = "kms";
    connector->modes = {test::make_mode(320, 200, 60)};
  }
  /// Returns the error that keeps the rig from being read.
  [[nodiscard]] Error rig_error() const {
    return test::error_of([this] { (void)make_plan(flags, false); });
  }
  void put_right() const {
    fs::copy_file(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/tiny.toml", flags.rig);
  }
};

TEST_F(RigError, IsShownOnTheConnectedPanelUntilTheRigIsRepaired) {
  const frames::WovenFrame expected =
      display::draw_test_card({320, 200}, error_card(flags.rig, rig_error()));
  std::vector<uint32_t> displayed;
  machine.at(machine.now() + seconds(3), [&] { displayed = card.displayed(crtc); });
  machine.at(machine.now() + seconds(12), [&] { put_right(); });
  const auto plan = plan_when_rig_is_right(flags, manager, options);
  ASSERT_TRUE(plan);
  EXPECT_GT(plan->display.panel.width, 0);
  EXPECT_EQ(displayed, test::words_of(expected));
  EXPECT_EQ(card.master_fd, -1) << "the card is free for the display";
  EXPECT_EQ(card.buffers.size(), 0u);
}

TEST_F(RigError, IsAnErrorOnAVirtualDisplay) {
  flags.display = "virtual";
  EXPECT_THROW((void)plan_when_rig_is_right(flags, manager, options), Error);
}

TEST_F(RigError, WaitsAlsoWithoutAConnectedPanel) {
  connector->connected = false;
  machine.at(machine.now() + seconds(12), [&] { put_right(); });
  EXPECT_TRUE(plan_when_rig_is_right(flags, manager, options));
}

TEST_F(RigError, InvalidFlagsAreStillAnError) {
  flags.loop = "never";
  EXPECT_THROW((void)plan_when_rig_is_right(flags, manager, options), Error);
}

}  // namespace
}  // namespace lenticule::player
