// SPDX-License-Identifier: Apache-2.0
// Tests trims: stored beside the rig, limited in size, and applied by every load of the rig.
#include "optics/trim.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "optics/model.h"
#include "optics/rig_file.h"
#include "tests/support/random_rigs.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::optics {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class TrimFile : public testing::Test {
 protected:
  void SetUp() override {
    rig_file_ = folder_ / "kiosk.toml";
    save_rig(test::kiosk_rig(), rig_file_);
  }

  void write(const std::string& text) const { std::ofstream(trim_file_of(rig_file_)) << text; }
  [[nodiscard]] std::string complaint(const std::string& text) const {
    write(text);
    try {
      (void)load_trimmed_rig(rig_file_);
      return "none";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
      return error.what();
    }
  }

  test::ScratchFolder scratch_;
  fs::path folder_ = scratch_.path();
  fs::path rig_file_;
};

TEST(Trim, LiesBesideItsRig) {
  EXPECT_EQ(trim_file_of("a/kiosk.toml"), fs::path("a/kiosk.trim.toml"));
  EXPECT_EQ(trim_file_of("kiosk"), fs::path("kiosk.trim.toml"));
  EXPECT_EQ(trim_file_of("kiosk.4k"), fs::path("kiosk.4k.trim.toml"));
  EXPECT_TRUE(is_trim_file("a/kiosk.trim.toml"));
  EXPECT_FALSE(is_trim_file("a/kiosk.toml"));
}

TEST(Trim, MovesThePhaseByItsOffsetAndKeepsTheCentre) {
  const Rig rig = test::kiosk_rig();
  const OpticalModel before(rig), after(trimmed(rig, {Lenses(0.25), 1e-4}));
  const double x = rig.panel.width_px / 2.0, y = rig.panel.height_px / 2.0;
  EXPECT_NEAR(after.lens_coordinate(x, y, 1) - before.lens_coordinate(x, y, 1), 0.25, 1e-12);
  const double lenses = 3.0 * x / rig.sheet.pitch.value;
  const double moved = after.lens_coordinate(2 * x, y, 1) - before.lens_coordinate(2 * x, y, 1);
  EXPECT_NEAR(moved, 0.25 + lenses * (1 / (1 + 1e-4) - 1), 1e-9);
  EXPECT_NE(fingerprint(after.rig()), fingerprint(rig));
}

TEST(Trim, StepsBackAndForthCancelExactly) {
  Trim trim;
  for (int n = 0; n < 10; ++n) trim = changed_by(trim, 0.01, 1e-5);
  EXPECT_EQ(trim, (Trim{Lenses(0.1), 1e-4}));
  for (int n = 0; n < 10; ++n) trim = changed_by(trim, -0.01, -1e-5);
  EXPECT_TRUE(trim.empty());
}

TEST(RigIdentity, KeepsTheCalibrationThroughATrim) {
  const Rig rig = test::kiosk_rig();
  const RigIdentity plain = identity_of(rig, {});
  const RigIdentity trimmed_once = identity_of(rig, {Lenses(0.01), 0.0});
  const RigIdentity trimmed_more = identity_of(rig, {Lenses(0.03), -1e-5});
  EXPECT_EQ(plain.fingerprint, fingerprint(rig));
  EXPECT_EQ(trimmed_once.calibration, fingerprint(rig));
  EXPECT_EQ(trimmed_once.fingerprint, fingerprint(trimmed(rig, trimmed_once.trim)));
  EXPECT_EQ(match(plain, plain), RigMatch::Same);
  EXPECT_EQ(match(trimmed_once, trimmed_once), RigMatch::Same);
  EXPECT_EQ(match(plain, trimmed_once), RigMatch::Trimmed);
  EXPECT_EQ(match(trimmed_once, plain), RigMatch::Trimmed);
  EXPECT_EQ(match(trimmed_once, trimmed_more), RigMatch::Trimmed);
  EXPECT_THAT(trim_difference(plain, trimmed_once),
              HasSubstr("before the rig was trimmed by +0.01 lens;"));
  EXPECT_THAT(trim_difference(trimmed_once, trimmed_more),
              HasSubstr("+0.02 lens and -1e-05 of the pitch"));
}

TEST(RigIdentity, OfAnotherCalibrationNeverMatches) {
  Rig other = test::kiosk_rig();
  other.sheet.gap = other.sheet.gap * 1.01;
  const Trim trim{Lenses(0.01), 0.0};
  EXPECT_EQ(match(identity_of(other, {}), identity_of(test::kiosk_rig(), {})), RigMatch::Other);
  EXPECT_EQ(match(identity_of(other, trim), identity_of(test::kiosk_rig(), trim)), RigMatch::Other);
  EXPECT_EQ(match(identity_of(other, trim), identity_of(test::kiosk_rig(), {})), RigMatch::Other);
}

TEST(RigIdentity, IsReadFromItsText) {
  const Rig rig = test::kiosk_rig();
  for (const Trim trim : {Trim{}, Trim{Lenses(0.01), 0.0}, Trim{Lenses(-0.123456789012), 3.3e-5},
                          Trim{Lenses(1.0), -0.01}}) {
    const RigIdentity identity = identity_of(rig, trim);
    EXPECT_LT(to_text(identity).size(), 128u);
    EXPECT_EQ(parse_identity(to_text(identity)), identity);
  }
}

TEST(RigIdentity, AnyOtherTextIsAPlainFingerprint) {
  const std::string calibration = fingerprint(test::kiosk_rig());
  for (const std::string& text :
       {std::string(), std::string("beef"), "beef trims " + calibration,
        "beef trims " + calibration + " 0.01", "beef trims " + calibration + " 0.01 0 0",
        "beef trims " + calibration + " 2 0", "beef trims " + calibration + " nan 0",
        "beef of " + calibration + " 0.01 0", "beef trims " + calibration + " 0.010 0"}) {
    const RigIdentity read = parse_identity(text);
    EXPECT_EQ(read.fingerprint, text);
    EXPECT_TRUE(read.trim.empty());
    const RigMatch expected = text.empty() ? RigMatch::Same : RigMatch::Other;
    EXPECT_EQ(match(read, identity_of(test::kiosk_rig(), {})), expected) << text;
  }
}

TEST_F(TrimFile, IsReadBackUnchanged) {
  EXPECT_EQ(load_trimmed_rig(rig_file_), test::kiosk_rig()) << "no file, no trim";
  const Trim trim{Lenses(-0.1234567890123), 3.3e-5};
  save_trim(trim, rig_file_);
  EXPECT_EQ(load_trim(rig_file_), trim);
  EXPECT_EQ(load_trimmed_rig(rig_file_), trimmed(test::kiosk_rig(), trim));
  EXPECT_EQ(load_rig(rig_file_), test::kiosk_rig()) << "the calibration stays";
  save_trim({}, rig_file_);
  EXPECT_FALSE(fs::exists(trim_file_of(rig_file_)));
  save_trim({}, rig_file_);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
}

TEST_F(TrimFile, ErrorsNameFileAndLine) {
  const std::string file = trim_file_of(rig_file_).string();
  EXPECT_THAT(complaint("offset_lenses = 0.1\npitch = 2\n"),
              HasSubstr(file + ":2: unknown key 'pitch'"));
  EXPECT_THAT(complaint("\n\noffset_lenses = \"a\""),
              HasSubstr(file + ":3: 'offset_lenses' is not a number"));
  EXPECT_THAT(complaint("offset_lenses = ["), HasSubstr(file + ":1: "));
  EXPECT_THAT(complaint("offset_lenses = 1.5"), HasSubstr("more than a lens"));
  EXPECT_THAT(complaint("offset_lenses = nan"), HasSubstr("offset_lenses: nan"));
  EXPECT_THAT(complaint("pitch_relative = -0.02"), HasSubstr("pitch_relative: -0.02"));
  EXPECT_THAT(complaint(std::string(100'000, '#')), HasSubstr("the limit is 65536 bytes"));
  EXPECT_THAT(complaint("# nothing\n"), "none");
}

TEST_F(TrimFile, ThatIsNotAFileIsAnError) {
  fs::create_directory(trim_file_of(rig_file_));
  EXPECT_THROW((void)load_trimmed_rig(rig_file_), Error);
  fs::remove(trim_file_of(rig_file_));
  fs::create_symlink(folder_ / "nowhere", trim_file_of(rig_file_));
  EXPECT_THROW((void)load_trimmed_rig(rig_file_), Error);
}

TEST_F(TrimFile, ValuesOutOfRangeAreNotSaved) {
  EXPECT_THROW(save_trim({Lenses(2.0), 0.0}, rig_file_), Error);
  EXPECT_THROW(save_trim({Lenses(0.0), std::nan("")}, rig_file_), Error);
  EXPECT_FALSE(fs::exists(trim_file_of(rig_file_)));
}

}  // namespace
}  // namespace lenticule::optics
