// SPDX-License-Identifier: Apache-2.0
// Tests which rig a command takes that is given none.
#include "player/process/rig_choice.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>

#include "optics/rig_file.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/kms/kms_stage.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class RigChoice : public test::KmsStage {
 protected:
  test::ScratchFolder scratch;
  fs::path folder = scratch.path();
  fs::path users = folder / "users", systems = folder / "systems";
  RigRequest request{.display = "kms", .folders = {users, systems}, .kms = options};

  void SetUp() override {
    fs::create_directories(users);
    fs::create_directories(systems);
    connector->modes = {test::make_mode(48, 32, 60)};
  }

  /// Writes a rig of a panel of 48x32 pixels with this serial number.
  std::string write(const fs::path& file, const std::string& serial,
                    const char* mounting = "0") const {
    optics::Rig rig =
        optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/tiny.toml");
    rig.identity.serial = serial;
    rig.panel.mounting = optics::mounting_named(mounting);
    if (rig.panel.sent_size().width != 48) std::swap(rig.panel.width_px, rig.panel.height_px);
    optics::save_rig(rig, file);
    return file.string();
  }
  [[nodiscard]] Error refusal() const {
    return test::error_of([this] { (void)choose_rig(request); });
  }
};

TEST_F(RigChoice, IsTheRigThatNamesTheConnectedPanel) {
  (void)write(systems / "hall.toml", "TWO");
  (void)write(systems / "any.toml", "");
  (void)write(systems / "lobby.1.toml", "ONE");  // an older version
  const std::string lobby = write(systems / "lobby.toml", "ONE");
  for (const char* display : {"kms", "kms:HDMI-A-1", "virtual", "window", ""}) {
    request.display = display;
    EXPECT_EQ(choose_rig(request).file, lobby) << display;
  }
  const std::string own = write(users / "own.toml", "ONE");
  EXPECT_EQ(choose_rig(request).file, own);
  request.given = "given.toml";
  EXPECT_EQ(choose_rig(request).file, "given.toml");
}

TEST_F(RigChoice, IsAlsoTheRigOfATurnedPanel) {
  const std::string turned = write(systems / "turned.toml", "ONE", "90");
  EXPECT_EQ(choose_rig(request).file, turned);
}

TEST_F(RigChoice, ListsTheRigsIfSeveralNameThePanel) {
  const std::string a = write(systems / "a.toml", "ONE"), b = write(systems / "b.toml", "ONE");
  test::expect_error(refusal(), ErrorKind::Usage, "HDMI-A-1: LGD 0x1234", a + ", " + b);
}

TEST_F(RigChoice, IsNeverASampleForAPanel) {
  const std::string other = write(systems / "other.toml", "TWO");
  test::expect_error(refusal(), ErrorKind::Usage, other, "lenticule panels");
  connector->connected = false;
  EXPECT_EQ(refusal().kind(), ErrorKind::Device);
}

TEST_F(RigChoice, IsTheUsualSampleWithoutARigOfThePanel) {
  (void)write(systems / "other.toml", "TWO");
  request.display = "virtual";
  EXPECT_THAT(choose_rig(request).file, HasSubstr("rigs/kiosk-27-4k.toml"));
}

TEST_F(RigChoice, WaitsForAPanelThatIsOffAtTheStart) {
  const std::string lobby = write(systems / "lobby.toml", "ONE");
  connector->connected = false;
  machine.at(machine.now() + std::chrono::seconds(5), [this] { connector->connected = true; });
  std::vector<std::string> reasons;
  const auto note = [&](const Error& reason) { reasons.emplace_back(reason.what()); };
  EXPECT_THROW((void)choose_rig_when_connected(request, std::chrono::seconds(2), note), Error);
  const size_t before = reasons.size();
  EXPECT_GT(before, 0u);
  const auto chosen = choose_rig_when_connected(request, std::nullopt, note);
  ASSERT_TRUE(chosen);
  EXPECT_EQ(chosen->file, lobby);
  EXPECT_GT(reasons.size(), before);
}

}  // namespace
}  // namespace lenticule::player
