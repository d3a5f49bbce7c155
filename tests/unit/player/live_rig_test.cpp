// SPDX-License-Identifier: Apache-2.0
// Tests trimming while playing: how keys change the trim, its file and the displayed views, and
// that the terminal is restored.
#include "player/sources/live_rig.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <termios.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <string>
#include <thread>

#include "base/error.h"
#include "frames/charts/charts.h"
#include "optics/rig_file.h"
#include "player/process/key_input.h"
#include "player/sources/still_source.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LiveRigTest : public testing::Test {
 protected:
  void SetUp() override {
    rig_file_ = folder_ / "tiny.toml";
    rig_ = optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/tiny.toml");
    optics::save_rig(rig_, rig_file_);
  }

  test::ScratchFolder scratch_;
  fs::path folder_ = scratch_.path();
  fs::path rig_file_;
  optics::Rig rig_;
};

TEST_F(LiveRigTest, EveryKeyPressIsSavedAndEscapeUndoesAll) {
  optics::save_trim({Lenses(0.5), 0.0}, rig_file_);
  LiveRig trim(rig_file_);
  const uint64_t version = trim.version();
  EXPECT_THAT(trim.press({Key::Right}), HasSubstr("+0.510 lenses"));
  EXPECT_NE(trim.press({Key::Left, Stride::Coarse}), "");
  EXPECT_NE(trim.press({Key::Up}), "");
  EXPECT_NE(trim.press({Key::Down, Stride::Fine}), "");
  EXPECT_EQ(optics::load_trim(rig_file_), (optics::Trim{Lenses(0.41), 9e-6}));
  EXPECT_EQ(trim.rig(), optics::load_trimmed_rig(rig_file_));
  EXPECT_EQ(trim.version(), version + 4);
  EXPECT_NE(trim.press({Key::Restore}), "");
  EXPECT_EQ(optics::load_trim(rig_file_), (optics::Trim{Lenses(0.5), 0.0}));
}

TEST_F(LiveRigTest, OtherKeysAreIgnored) {
  LiveRig trim(rig_file_);
  for (const Key key : {Key::Next, Key::Quit, Key::Undo, Key::Restore})
    EXPECT_EQ(trim.press({key}), "");
  EXPECT_EQ(trim.version(), 1u);
  EXPECT_FALSE(fs::exists(optics::trim_file_of(rig_file_)));
}

TEST_F(LiveRigTest, TrimStaysWithinItsLimits) {
  LiveRig trim(rig_file_);
  for (int n = 0; n < 10; ++n) (void)trim.press({Key::Right, Stride::Coarse});
  EXPECT_THAT(trim.press({Key::Right, Stride::Coarse}), HasSubstr("the trim is unchanged"));
  EXPECT_NEAR(optics::load_trim(rig_file_).offset.value, 1.0, 1e-12);
}

TEST_F(LiveRigTest, AnUnsavableTrimIsAppliedAndSavedLater) {
  LiveRig trim(rig_file_);
  const fs::path away = folder_.string() + "-away";
  fs::rename(folder_, away);
  EXPECT_THAT(trim.press({Key::Left}), HasSubstr("not saved yet"));
  EXPECT_NEAR(trim.rig().sheet.offset.value, rig_.sheet.offset.value - 0.01, 1e-12);
  EXPECT_NE(trim.why_unsaved(), "");
  EXPECT_EQ(trim.writes().state().failures, 1u);
  fs::rename(away, folder_);
  trim.writes().try_at_once();
  trim.save_again();
  EXPECT_EQ(optics::load_trim(rig_file_), (optics::Trim{Lenses(-0.01), 0.0}));
  EXPECT_EQ(trim.why_unsaved(), "");
  EXPECT_EQ(trim.writes().state().reason, "");
}

TEST_F(LiveRigTest, ATrimOfARigThatCannotKeepItIsAppliedAndSaysWhyItIsNotSaved) {
  LiveRig trim(rig_file_, "the film contains the rig");
  (void)trim.change([](const optics::Trim&) { return optics::Trim{Lenses(0.1), 0.0}; });
  EXPECT_NEAR(trim.rig().sheet.offset.value, rig_.sheet.offset.value + 0.1, 1e-12);
  EXPECT_EQ(trim.why_unsaved(), "the film contains the rig");
  trim.save_again();
  EXPECT_FALSE(fs::exists(optics::trim_file_of(rig_file_)));
  EXPECT_THROW((void)trim.replace_rig(rig_), Error);
}

TEST_F(LiveRigTest, CanBeReadWhileAChangeTakesLong) {
  LiveRig rig(rig_file_);
  std::promise<void> begun, ended;
  std::thread changing([&] {
    (void)rig.change([&](const optics::Trim& trim) {
      begun.set_value();
      ended.get_future().wait();
      return trim;
    });
  });
  begun.get_future().wait();
  EXPECT_EQ(rig.trim(), optics::Trim{});
  EXPECT_EQ(rig.rig(), rig_);
  EXPECT_EQ(rig.complaint(), "");
  EXPECT_EQ(rig.why_unsaved(), "");
  ended.set_value();
  changing.join();
}

TEST_F(LiveRigTest, FollowsFilesThatAnotherProgramReplaced) {
  LiveRig trim(rig_file_);
  optics::save_trim({Lenses(0.25), 0.0}, rig_file_);
  trim.look();
  EXPECT_EQ(trim.rig(), optics::load_trimmed_rig(rig_file_));
  optics::Rig other = rig_;
  other.sheet.offset = Lenses(0.125);
  optics::save_rig(other, rig_file_);
  trim.look();
  EXPECT_EQ(trim.rig(), optics::load_trimmed_rig(rig_file_));
  const uint64_t version = trim.version();
  std::ofstream(rig_file_) << "this is no rig";
  trim.look();
  other.panel.width_px += 1;
  optics::save_rig(other, rig_file_);
  trim.look();
  EXPECT_EQ(trim.version(), version) << "nothing that can be used is followed by nothing";
}

TEST_F(LiveRigTest, ANewCalibrationReplacesRigAndTrimAndKeepsTheOldFile) {
  optics::save_trim({Lenses(0.5), 0.0}, rig_file_);
  LiveRig trim(rig_file_);
  const uint64_t version = trim.version();
  optics::Rig found = rig_;
  found.sheet.pitch.value *= 1.001;
  EXPECT_EQ(trim.replace_rig(found), folder_ / "tiny.1.toml");
  EXPECT_EQ(optics::load_rig(rig_file_), found);
  EXPECT_EQ(optics::load_rig(folder_ / "tiny.1.toml"), rig_);
  EXPECT_EQ(trim.rig(), found);
  EXPECT_TRUE(optics::load_trim(rig_file_).empty());
  EXPECT_GT(trim.version(), version);
}

TEST_F(LiveRigTest, ARigOfAnotherPanelChangesNothing) {
  LiveRig trim(rig_file_);
  optics::Rig wider = rig_, other_panel = rig_;
  wider.panel.width_px += 1;
  other_panel.identity.serial = "another";
  for (const optics::Rig& wrong : {wider, other_panel})
    EXPECT_THROW((void)trim.replace_rig(wrong), Error);
  EXPECT_EQ(optics::load_rig(rig_file_), rig_);
  EXPECT_FALSE(fs::exists(folder_ / "tiny.1.toml"));
}

TEST_F(LiveRigTest, KeepsTheLastGoodRigAndReportsTheReason) {
  LiveRig rig(rig_file_);
  EXPECT_EQ(rig.rig(), rig_);
  std::ofstream(rig_file_) << "broken [";
  rig.look();
  EXPECT_EQ(rig.rig(), rig_);
  EXPECT_THAT(rig.complaint(), HasSubstr("tiny.toml:1"));
  optics::Rig other = rig_;
  other.panel.width_px += 1;
  optics::save_rig(other, rig_file_);
  rig.look();
  EXPECT_EQ(rig.rig(), rig_);
  EXPECT_THAT(rig.complaint(), HasSubstr("is for a panel of"));
  EXPECT_EQ(rig.version(), 1u);
  other.panel = rig_.panel;
  other.sheet.offset = Lenses(0.125);
  optics::save_rig(other, rig_file_);
  rig.look();
  EXPECT_EQ(rig.rig(), other);
  EXPECT_EQ(rig.complaint(), "");
  EXPECT_EQ(rig.version(), 2u);
  fs::remove(rig_file_);
  rig.look();
  EXPECT_EQ(rig.rig(), other);
  EXPECT_THAT(rig.complaint(), HasSubstr("tiny.toml"));
}

TEST_F(LiveRigTest, DoesNotFollowWhatTheDisplayReadAtItsStart) {
  LiveRig rig(rig_file_);
  optics::Rig other = rig_;
  other.panel.bits = optics::kDeepBits;
  optics::save_rig(other, rig_file_);
  rig.look();
  EXPECT_EQ(rig.rig(), rig_);
  EXPECT_THAT(rig.complaint(), HasSubstr("another panel.bits"));
  other.panel.bits = rig_.panel.bits;
  other.panel.mounting = optics::mounting_named("180");
  optics::save_rig(other, rig_file_);
  rig.look();
  EXPECT_EQ(rig.rig(), rig_);
  EXPECT_THAT(rig.complaint(), HasSubstr("another panel.mounting"));
}

TEST_F(LiveRigTest, KeepsATrimThatIsNotSavedYet) {
  LiveRig rig(rig_file_);
  fs::create_directories(optics::trim_file_of(rig_file_) / "in the way");
  EXPECT_THAT(rig.press({Key::Right, Stride::Coarse}), HasSubstr("not saved yet"));
  const optics::Rig trimmed = rig.rig();
  rig.read_again();
  rig.look();
  EXPECT_EQ(rig.rig(), trimmed);
  EXPECT_NE(rig.rig(), rig_);
}

TEST_F(LiveRigTest, NewViewsFollowTheTrimWhileAcquiredFramesStay) {
  const auto trim = std::make_shared<LiveRig>(rig_file_);
  StillSource source(trim);
  const auto woven_for = [](const optics::Rig& rig) {
    return frames::draw_chart({.pattern = frames::ChartPattern::NumberedViews, .rig = rig});
  };
  const auto same = [](const frames::FrameView& a, const frames::WovenFrame& b) {
    return std::equal(a.bytes.begin(), a.bytes.end(), b.bytes().begin(), b.bytes().end());
  };
  frames::AcquiredFrame first, second;
  ASSERT_EQ(source.pull(first), frames::PullStatus::Ready);
  EXPECT_EQ(source.pull(second), frames::PullStatus::End);
  EXPECT_TRUE(same(first.frame, woven_for(rig_)));
  ASSERT_NE(trim->press({Key::Right, Stride::Coarse}), "");
  ASSERT_TRUE(source.rewind());
  ASSERT_EQ(source.pull(second), frames::PullStatus::Ready);
  EXPECT_TRUE(same(second.frame, woven_for(trim->rig())));
  EXPECT_FALSE(same(second.frame, woven_for(rig_)));
  EXPECT_TRUE(same(first.frame, woven_for(rig_))) << "it may be pending";
  source.release(first.token);
  source.release(second.token);
}

class PseudoTerminal {
 public:
  PseudoTerminal() : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) return;
    slave_ = open(ptsname(master_), O_RDWR | O_NOCTTY | O_CLOEXEC);
  }
  ~PseudoTerminal() {
    if (slave_ >= 0) close(slave_);
    if (master_ >= 0) close(master_);
  }
  [[nodiscard]] int slave() const { return slave_; }
  [[nodiscard]] tcflag_t local_flags() const {
    termios now{};
    EXPECT_EQ(tcgetattr(slave_, &now), 0);
    return now.c_lflag;
  }

 private:
  int master_;
  int slave_ = -1;
};

TEST(RawTerminalTest, IsRestoredOnEveryExitPath) {
  const PseudoTerminal terminal;
  ASSERT_GE(terminal.slave(), 0);
  const tcflag_t before = terminal.local_flags();
  ASSERT_NE(before & ICANON, 0u);
  {
    const RawTerminal raw(terminal.slave());
    EXPECT_EQ(terminal.local_flags() & (ICANON | ECHO), 0u);
    EXPECT_NE(terminal.local_flags() & ISIG, 0u) << "Ctrl-C still interrupts";
  }
  EXPECT_EQ(terminal.local_flags(), before);
  {
    const RawTerminal raw(terminal.slave());
    restore_terminal_now();
    EXPECT_EQ(terminal.local_flags(), before);
  }
  restore_terminal_now();
  EXPECT_EQ(terminal.local_flags(), before);
}

TEST(RawTerminalTest, NeedsATerminal) {
  const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
  EXPECT_THROW(RawTerminal raw(nothing), Error);
  close(nothing);
}

}  // namespace
}  // namespace lenticule::player
