// SPDX-License-Identifier: Apache-2.0
// Tests that frames are written with exact code values, completely or not at all.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "frames/image_io.h"
#include "frames/srgb.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using test::ScratchFolder;
using ::testing::HasSubstr;

/// Returns a frame with every code value in every channel.
WovenFrame all_codes() {
  WovenFrame frame({.width = 256, .height = 3});
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 256; ++i)
      for (int c = 0; c < 3; ++c)
        frame.row(j)[3 * i + c] = static_cast<uint8_t>((i * (j + 1) + 85 * c) & 0xFF);
  return frame;
}

/// Simulates a full disk with a limit on this process's file size, and ignores the limit's signal.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int) = SIG_DFL;
};

class WrittenAs : public ::testing::TestWithParam<const char*> {
 protected:
  ScratchFolder folder_;
};

TEST_P(WrittenAs, KeepsEveryCodeValue) {
  const auto file = folder_ / (std::string("frame") + GetParam());
  write_woven(all_codes().view(), file);
  EXPECT_EQ(read_woven(file), all_codes());
  EXPECT_EQ(folder_.entries(), 1u) << "temporary files left";
}

TEST_P(WrittenAs, EqualPixelsGiveEqualBytes) {
  const auto file = folder_ / (std::string("frame") + GetParam());
  write_woven(all_codes().view(), file);
  const auto bytes = test::read_bytes(file);
  const std::string text(bytes.begin(), bytes.end());
  const std::string year = std::to_string(
      static_cast<int>(std::chrono::year_month_day(
                           std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now()))
                           .year()));
  EXPECT_THAT(text, ::testing::Not(HasSubstr(year + ":"))) << "a date in the file";
}

TEST_P(WrittenAs, OnAFullDiskLeavesNothing) {
  const auto file = folder_ / (std::string("frame") + GetParam());
  for (const rlim_t limit : {0, 1, 100, 300}) {
    const FileSizeLimit full(limit);
    const Error error = error_of([&] { write_woven(all_codes().view(), file); });
    EXPECT_EQ(error.kind(), ErrorKind::Failed);
    EXPECT_THAT(error.what(), HasSubstr(file.string() + ": cannot write"));
    EXPECT_EQ(folder_.entries(), 0u);
  }
}

TEST_P(WrittenAs, OnAFullDiskKeepsTheOldFile) {
  const auto file = folder_ / (std::string("frame") + GetParam());
  write_woven(all_codes().view(), file);
  {
    const FileSizeLimit full(100);
    error_of([&] { write_woven(WovenFrame({.width = 99, .height = 99}).view(), file); });
  }
  EXPECT_EQ(read_woven(file), all_codes());
  EXPECT_EQ(folder_.entries(), 1u);
}
INSTANTIATE_TEST_SUITE_P(Formats, WrittenAs,
                         ::testing::Values(".png", ".tif", ".tiff", ".exr", ".ppm", ".PNG"));

TEST(ImageWrite, FailuresNameFileAndCause) {
  const ScratchFolder folder;
  const WovenFrame frame({.width = 2, .height = 2});
  const Error missing = error_of([&] { write_woven(frame.view(), folder / "no/such/a.png"); });
  EXPECT_EQ(missing.kind(), ErrorKind::Failed);
  EXPECT_THAT(missing.what(), HasSubstr("a.png: cannot write: No such file or directory"));

  std::filesystem::create_directory(folder / "folder.png");
  EXPECT_THAT(error_of([&] { write_woven(frame.view(), folder / "folder.png"); }).what(),
              HasSubstr("Is a directory"));

  EXPECT_EQ(error_of([&] { write_woven(frame.view(), folder / "a.gif"); }).kind(),
            ErrorKind::Usage);
  EXPECT_EQ(error_of([&] { write_woven(frame.view(), folder / "a"); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([&] { write_woven(WovenFrame().view(), folder / "a.png"); }).kind(),
            ErrorKind::Failed);
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(ImageWrite, DevicesAreNotReplaced) {
  const ScratchFolder folder;
  std::filesystem::create_symlink("/dev/full", folder / "full.png");
  EXPECT_THAT(error_of([&] {
                write_woven(WovenFrame({.width = 2, .height = 2}).view(), folder / "full.png");
              }).what(),
              HasSubstr("not a regular file"));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(ImageWrite, ASymbolicLinkIsFollowed) {
  const ScratchFolder folder;
  write_woven(WovenFrame({.width = 2, .height = 2}).view(), folder / "real.png");
  std::filesystem::create_symlink("real.png", folder / "link.png");
  write_woven(all_codes().view(), folder / "link.png");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.png"));
  EXPECT_EQ(read_woven(folder / "real.png"), all_codes());
}

TEST(ImageWrite, AcceptsTheLongestNames) {
  const ScratchFolder folder;
  const auto file = folder / (std::string(251, 'x') + ".png");
  write_woven(all_codes().view(), file);
  EXPECT_EQ(read_woven(file), all_codes());
}

TEST(ImageWrite, ThreadsDoNotInterfere) {
  const ScratchFolder folder;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t)
      threads.emplace_back([&, t] {
        for (int n = 0; n < 4; ++n)
          for (const char* extension : {".png", ".exr"}) {
            const auto file = folder / (std::to_string(t) + extension);
            write_woven(all_codes().view(), file);
            EXPECT_EQ(read_woven(file), all_codes());
          }
      });
  }
  EXPECT_EQ(folder.entries(), 8u);
}

TEST(Srgb, EveryCodeSurvivesLinearLight) {
  for (int code = 0; code < 256; ++code)
    EXPECT_EQ(code_from_linear(linear_of_codes()[static_cast<size_t>(code)]), code);
}

/// Light half way between two codes, and the numbers beside it, decide between them.
TEST(Srgb, ChoosesTheNearestCodeOfLight) {
  for (int code = 0; code < 255; ++code) {
    const double limit = linear_from_srgb((code + 0.5) / 255.0);
    EXPECT_EQ(code_from_linear(std::nextafter(limit, 0.0)), code);
    EXPECT_EQ(code_from_linear(limit), code + 1);
  }
  int last = 0;
  constexpr int kSteps = 1 << 20;
  for (int step = 0; step <= kSteps; ++step) {
    const double light = static_cast<double>(step) / kSteps;
    const int code = code_from_linear(light);
    ASSERT_GE(code, last);
    ASSERT_NEAR(code, srgb_from_linear(light) * 255.0, 0.5 + 1e-9);
    last = code;
  }
}

TEST(Srgb, ClipsLightOutOfRange) {
  EXPECT_EQ(code_from_linear(-1.0), 0);
  EXPECT_EQ(code_from_linear(2.0), 255);
  EXPECT_EQ(code_from_linear(std::numeric_limits<double>::quiet_NaN()), 0);
  EXPECT_EQ(code_from_linear(std::numeric_limits<double>::infinity()), 255);
}

}  // namespace
}  // namespace lenticule::frames
