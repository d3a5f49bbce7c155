// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "base/error.h"
#include "base/file.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::optics {
namespace {

namespace fs = std::filesystem;

class RigStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "etc");
    fs::create_directories(folder_ / "var");
    rig_ = load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/tiny.toml");
    save_rig(rig_, given_);
  }
  /// Returns the rig with another offset of the sheet.
  [[nodiscard]] Rig moved(double lenses) const {
    Rig rig = rig_;
    rig.sheet.offset = rig.sheet.offset + Lenses(lenses);
    return rig;
  }
  [[nodiscard]] RigStore store() const { return {given_, copy_}; }

  test::ScratchFolder scratch_;
  fs::path folder_ = scratch_.path();
  fs::path given_ = folder_ / "etc/lobby.toml", copy_ = folder_ / "var/lobby.toml";
  Rig rig_;
};

TEST_F(RigStoreTest, UsesTheGivenRigUntilItHasMadeACopy) {
  EXPECT_EQ(store().in_use(), given_);
  save_trim({Lenses(0.25), 1e-5}, given_);
  EXPECT_TRUE(store().update());
  EXPECT_EQ(store().in_use(), copy_);
  EXPECT_EQ(load_rig(copy_), rig_);
  EXPECT_EQ(load_trim(copy_), (Trim{Lenses(0.25), 1e-5}));
  EXPECT_FALSE(store().differs());
  EXPECT_FALSE(store().update()) << "it is up to date";
}

TEST_F(RigStoreTest, ACalibrationOfTheCopySurvivesRestarts) {
  (void)store().update();
  save_rig(moved(0.2), copy_);
  save_trim({Lenses(0.1), 0.0}, copy_);
  EXPECT_FALSE(store().update());
  EXPECT_EQ(store().in_use(), copy_);
  EXPECT_EQ(load_rig(copy_), moved(0.2));
  EXPECT_EQ(load_trim(copy_), (Trim{Lenses(0.1), 0.0}));
  EXPECT_TRUE(store().differs());
}

TEST_F(RigStoreTest, AnEditedRigReplacesTheCopyAndKeepsTheOldOne) {
  RigStore store = this->store();
  (void)store.update();
  save_rig(moved(0.2), copy_);
  EXPECT_FALSE(store.update_if_edited());
  save_rig(moved(0.3), given_);
  EXPECT_EQ(store.in_use(), given_) << "a renderer does not use an outdated copy";
  EXPECT_TRUE(store.update_if_edited());
  EXPECT_EQ(load_rig(copy_), moved(0.3));
  EXPECT_EQ(load_rig(folder_ / "var/lobby.1.toml"), moved(0.2));
  EXPECT_EQ(store.in_use(), copy_);
}

TEST_F(RigStoreTest, AnEditedTrimCountsAsAnEditedRig) {
  RigStore store = this->store();
  (void)store.update();
  save_trim({Lenses(0.1), 0.0}, copy_);
  save_trim({Lenses(0.4), 0.0}, given_);
  EXPECT_TRUE(store.update_if_edited());
  EXPECT_EQ(load_trim(copy_), (Trim{Lenses(0.4), 0.0}));
}

TEST_F(RigStoreTest, ARigThatIsNotValidChangesNothing) {
  RigStore store = this->store();
  (void)store.update();
  save_rig(moved(0.2), copy_);
  write_text_file(given_, "no rig");
  EXPECT_THROW((void)store.update(), Error);
  EXPECT_EQ(load_rig(copy_), moved(0.2));
  save_rig(rig_, given_);
  EXPECT_FALSE(store.update()) << "the text is the one that the copy was made from";
  EXPECT_EQ(load_rig(copy_), moved(0.2));
}

TEST_F(RigStoreTest, ADamagedOrMissingCopyIsMadeAgain) {
  (void)store().update();
  write_text_file(copy_, "damaged");
  EXPECT_EQ(store().in_use(), given_);
  EXPECT_TRUE(store().update());
  EXPECT_EQ(load_rig(copy_), rig_);
  fs::remove(copy_);
  EXPECT_TRUE(store().update());
  EXPECT_EQ(load_rig(copy_), rig_);
}

TEST_F(RigStoreTest, WithoutItsFolderTheRigItselfIsUsed) {
  fs::remove_all(folder_ / "var");
  EXPECT_THROW((void)store().update(), Error);
  EXPECT_EQ(store().in_use(), given_);
}

}  // namespace
}  // namespace lenticule::optics
