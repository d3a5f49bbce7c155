// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "base/text.h"
#include "calib/report/report.h"
#include "optics/rig_file.h"
#include "sample_calibration.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::calib {
namespace {

using test::error_of;
using test::sample_calibration;
using test::sample_details;
using test::sample_rig;
using test::ScratchFolder;
using ::testing::HasSubstr;

std::string entry(const optics::Rig& rig, const std::string& key) {
  for (const auto& [name, text] : rig.provenance)
    if (name == key) return text;
  return "none";
}

std::string content(const std::filesystem::path& file) {
  const auto bytes = test::read_bytes(file);
  return {bytes.begin(), bytes.end()};
}

TEST(RigRecord, StatesTheOriginOfItsNumbers) {
  const optics::Rig rig = with_record(sample_calibration(), sample_details());
  EXPECT_EQ(entry(rig, "date"), "2026-03-01T12:34:56Z");
  EXPECT_EQ(entry(rig, "tool"), std::string("lenticule ") + LENTICULE_VERSION);
  EXPECT_EQ(entry(rig, "method"), "camera");
  EXPECT_EQ(entry(rig, "camera"), "Webcam");
  EXPECT_EQ(entry(rig, "camera_pixel_format"), "YUYV");
  EXPECT_EQ(entry(rig, "temperature_celsius"), "24.5");
  EXPECT_EQ(entry(rig, "verdict"), "intrinsic");
  EXPECT_EQ(entry(rig, "valid_for"), "every eye");
  EXPECT_EQ(entry(rig, "residual_max_lenses"), "0.0117");
  EXPECT_EQ(entry(rig, "held_out_max_lenses"), "0.031");
  EXPECT_THAT(entry(rig, "viewpoints_mm"), HasSubstr("left (-240.0, 20.0, 700.0)"));
  EXPECT_THAT(entry(rig, "viewpoints_mm"), HasSubstr("near (10.0, 20.0, 700.0) kept aside"));
  EXPECT_THAT(entry(rig, "standard_errors"), HasSubstr("pitch_subpx 4.2e-06"));
  EXPECT_THAT(entry(rig, "panel"), HasSubstr("serial 0000000000001"));
  EXPECT_EQ(optics::fingerprint(rig), optics::fingerprint(sample_rig()));
}

TEST(RigRecord, StatesThatACalibrationIsEffective) {
  Calibration c = sample_calibration();
  c.verdict = Verdict::Effective;
  c.reasons = {"one viewpoint only"};
  const optics::Rig rig = with_record(c, sample_details());
  EXPECT_THAT(entry(rig, "valid_for"), HasSubstr("effective: holds only at the eye"));
  EXPECT_THAT(entry(rig, "valid_for"), HasSubstr("(0.0, 20.0, 700.0) mm"));
  EXPECT_EQ(entry(rig, "reasons"), "one viewpoint only");
}

TEST(RigRecord, SurvivesARoundTripThroughTheRigFile) {
  Calibration c = sample_calibration();
  RecordDetails details = sample_details();
  details.camera.name = "bad \xff\x01 \"name\" \\ <x>\n";
  c.reasons = {std::string(10000, 'x')};
  const optics::Rig rig = with_record(c, details);
  EXPECT_EQ(optics::parse_rig(optics::rig_to_toml(rig), "text"), rig);
  EXPECT_EQ(entry(rig, "reasons").size(), 4096U);
}

TEST(RigRecord, EarlierOriginsBecomeHistory) {
  Calibration c = sample_calibration();
  c.rig.provenance = {{"source", "visual.json"}, {"note", "imported"}};
  optics::Rig rig = with_record(c, sample_details());
  EXPECT_EQ(entry(rig, "history_1"), "source: visual.json | note: imported");
  EXPECT_EQ(entry(rig, "source"), "none");
  c.rig = rig;
  rig = with_record(c, sample_details());
  EXPECT_EQ(entry(rig, "history_1"), "source: visual.json | note: imported");
  EXPECT_THAT(entry(rig, "history_2"), HasSubstr("date: 2026-03-01T12:34:56Z | tool: lenticule"));
  EXPECT_EQ(entry(rig, "history_3"), "none");
}

TEST(RigRecord, LongOriginsAreShortened) {
  Calibration c = sample_calibration();
  c.rig.provenance = {{"note", std::string(4000, 'x')}, {"more", std::string(4000, 'y')}};
  const optics::Rig rig = with_record(c, sample_details());
  EXPECT_FALSE(optics::find_problem(rig));
  EXPECT_EQ(entry(rig, "history_1").size(), 4096U);
}

TEST(RigRecord, ThreeHundredCalibrationsDropTheOldestAndCountThem) {
  Calibration c = sample_calibration();
  RecordDetails details = sample_details();
  for (int i = 0; i < 300; ++i) {
    details.method = "camera " + std::to_string(i);
    c.rig = with_record(c, details);
    ASSERT_LE(c.rig.provenance.size(), 256U);
  }
  EXPECT_FALSE(optics::find_problem(c.rig));
  EXPECT_EQ(entry(c.rig, "method"), "camera 299");
  EXPECT_THAT(entry(c.rig, "history_299"), HasSubstr("method: camera 298"));
  EXPECT_EQ(entry(c.rig, "history_1"), "none");
  size_t kept = 0;
  for (const auto& [key, text] : c.rig.provenance) kept += key.starts_with("history_") ? 1 : 0;
  const size_t dropped = std::stoul(entry(c.rig, "history_dropped"));
  EXPECT_EQ(kept - 1 + dropped, 299U);
  EXPECT_GT(dropped, 0U);
  EXPECT_EQ(optics::parse_rig(optics::rig_to_toml(c.rig), "text"), c.rig);
}

TEST(RigRecord, ToleratesHandWrittenHistory) {
  Calibration c = sample_calibration();
  c.rig.provenance = {{"history_99999999999999999999", "far"},
                      {"history_", "none"},
                      {"history_dropped", "many"},
                      {"history_999999999", "last"}};
  const optics::Rig rig = with_record(c, sample_details());
  EXPECT_FALSE(optics::find_problem(rig));
  EXPECT_EQ(entry(rig, "history_999999999"), "last");
  EXPECT_EQ(optics::parse_rig(optics::rig_to_toml(rig), "text"), rig);
}

TEST(SaveWithHistory, DoesNotCopyBeforeTheFirstSave) {
  const ScratchFolder folder;
  EXPECT_TRUE(save_with_history(sample_rig(), folder / "rig.toml").empty());
  EXPECT_EQ(optics::load_rig(folder / "rig.toml"), sample_rig());
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(SaveWithHistory, KeepsTheOldBytesBesideTheNewFile) {
  const ScratchFolder folder;
  const auto file = folder / "rig.toml";
  for (const char* old : {"# by hand\n", "second", ""}) {
    std::ofstream(file) << old;
    const auto copy = save_with_history(sample_rig(), file);
    EXPECT_EQ(content(copy), old);
    EXPECT_EQ(optics::load_rig(file), sample_rig());
  }
  EXPECT_EQ(content(folder / "rig.1.toml"), "# by hand\n");
  EXPECT_EQ(content(folder / "rig.2.toml"), "second");
  EXPECT_EQ(folder.entries(), 4U);
}

TEST(SaveWithHistory, NeverOverwritesAnExistingCopy) {
  const ScratchFolder folder;
  const auto file = folder / "rig.toml";
  std::ofstream(file) << "old";
  std::ofstream(folder / "rig.7.toml") << "kept";
  std::ofstream(folder / "rig.99999999999999999999.toml") << "not ours";
  std::ofstream(folder / "other.9.toml") << "not ours";
  EXPECT_EQ(save_with_history(sample_rig(), file), folder / "rig.8.toml");
  EXPECT_EQ(content(folder / "rig.7.toml"), "kept");
}

/// Ends the child process rather than running the remaining tests in it.
bool every_save_copies(const std::filesystem::path& file, int saves) noexcept {
  bool copied = true;
  for (int i = 0; i < saves; ++i) copied = copied && !save_with_history(sample_rig(), file).empty();
  return copied;
}

// Several programs save at once: each keeps the file that it replaces under a unique name.
TEST(SaveWithHistory, CopiesOfSeveralProgramsHaveDifferentNames) {
  const ScratchFolder folder;
  const auto file = folder / "rig.toml";
  std::ofstream(file) << "old";
  constexpr int kPrograms = 4, kSaves = 25;
  std::vector<pid_t> programs;
  for (int p = 0; p < kPrograms; ++p) {
    programs.push_back(::fork());
    if (programs.back() != 0) continue;
    ::_exit(every_save_copies(file, kSaves) ? 0 : 1);
  }
  for (const pid_t program : programs) {
    int status = 0;
    ASSERT_EQ(::waitpid(program, &status, 0), program);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(folder.entries(), 1U + kPrograms * kSaves);
}

/// Drops root's rights during its lifetime, since root may write everywhere.
class AsNobody {
 public:
  AsNobody() : was_root_(::geteuid() == 0) {
    if (was_root_ && ::seteuid(65534) != 0) ADD_FAILURE() << "cannot become nobody";
  }
  ~AsNobody() {
    if (was_root_ && ::seteuid(0) != 0) std::abort();
  }
  AsNobody(const AsNobody&) = delete;
  AsNobody& operator=(const AsNobody&) = delete;

 private:
  bool was_root_;
};

TEST(SaveWithHistory, KeepsTheOldRigInAReadOnlyFolder) {
  using std::filesystem::perms;
  const ScratchFolder folder;
  const auto file = folder / "rig.toml";
  std::ofstream(file) << "old";
  const perms readable = perms::owner_read | perms::owner_exec | perms::group_read |
                         perms::group_exec | perms::others_read | perms::others_exec;
  std::filesystem::permissions(folder.path(), readable);
  const Error error = [&] {
    const AsNobody nobody;
    return error_of([&] { (void)save_with_history(sample_rig(), file); });
  }();
  std::filesystem::permissions(folder.path(), perms::owner_all);
  EXPECT_EQ(error.kind(), ErrorKind::Failed);
  EXPECT_EQ(content(file), "old");
  EXPECT_EQ(folder.entries(), 1U);
}

/// Simulates a full disk by a limit on file sizes, which also applies to root.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit now{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &now);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int) = nullptr;
};

TEST(SaveWithHistory, AFullDiskChangesNothing) {
  const ScratchFolder folder;
  const auto file = folder / "rig.toml";
  std::ofstream(file) << "old";
  // Space for neither file; space for the copy, but not for the new rig.
  for (const rlim_t room : {0, 100}) {
    test::expect_error(error_of([&] {
                         const FullDisk full(room);
                         (void)save_with_history(sample_rig(), file);
                       }),
                       ErrorKind::Failed);
    EXPECT_EQ(content(file), "old");
    EXPECT_EQ(folder.entries(), 1U) << room;
  }
}

TEST(SaveWithHistory, AFailedCopyChangesNothing) {
  const ScratchFolder folder;
  const std::string long_name =
      std::string(250, 'r') + ".toml";  // no space for a number in the name
  std::ofstream(folder / long_name) << "old";
  test::expect_error(error_of([&] { (void)save_with_history(sample_rig(), folder / long_name); }),
                     ErrorKind::Failed);
  EXPECT_EQ(content(folder / long_name), "old");
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(SaveWithHistory, AnInvalidRigReplacesNothing) {
  const ScratchFolder folder;
  const auto file = folder / "rig.toml";
  std::ofstream(file) << "old";
  optics::Rig rig = sample_rig();
  rig.sheet.pitch = Subpixels(std::nan(""));
  test::expect_error(error_of([&] { (void)save_with_history(rig, file); }), ErrorKind::Input,
                     "pitch_subpx");
  EXPECT_EQ(content(file), "old");
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(SaveWithHistory, RefusesTargetsThatAreNotFiles) {
  const ScratchFolder folder;
  std::filesystem::create_directory(folder / "rig.toml");
  EXPECT_EQ(error_of([&] { (void)save_with_history(sample_rig(), folder / "rig.toml"); }).kind(),
            ErrorKind::Input);
}

// The rig file's own rule for printable text must accept everything that escaped() returns.
TEST(RigRecord, EveryPairOfBytesIsValidInARigFile) {
  optics::Rig rig = test::sample_rig();
  for (int first = 0; first < 256; ++first) {
    std::string all;
    for (int second = 0; second < 256; ++second) {
      all += static_cast<char>(first);
      all += static_cast<char>(second);
    }
    rig.provenance = {{"key", escaped(all)}};
    ASSERT_FALSE(optics::find_problem(rig)) << first;
    ASSERT_EQ(optics::parse_rig(optics::rig_to_toml(rig), "text"), rig) << first;
  }
}

}  // namespace
}  // namespace lenticule::calib
