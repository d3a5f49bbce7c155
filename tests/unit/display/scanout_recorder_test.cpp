// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_recorder.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <fstream>
#include <vector>

#include "base/error.h"
#include "display/scanout_format.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::display {
namespace {

namespace fs = std::filesystem;

constexpr frames::FrameGeometry kSmall{.width = 11, .height = 3};

/// Scan-out memory that holds a numbered frame.
struct Scanout {
  frames::WovenFrame frame;
  std::vector<uint32_t> words;

  ScanoutDepth depth;

  explicit Scanout(uint64_t number, ScanoutDepth memory = ScanoutDepth::Bits8)
      : frame(test::numbered_frame(kSmall, number)), words(16 * 3), depth(memory) {
    for (int j = 0; j < kSmall.height; ++j)
      expand_row(depth, frame.row(j), words.data() + 16 * j, static_cast<size_t>(kSmall.width));
  }
  [[nodiscard]] ScanoutView view() const {
    return {.pixels = words.data(), .stride = 16, .geometry = kSmall, .depth = depth};
  }
};

class Recorder : public testing::Test {
 protected:
  test::ScratchFolder scratch;
  fs::path folder = scratch.path();

  [[nodiscard]] std::vector<std::string> listing() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder))
      names.push_back(entry.path().filename().string());
    return names;
  }
  [[nodiscard]] std::string path(const char* name) const { return (folder / name).string(); }
};

TEST_F(Recorder, WritesOneChecksumLinePerFrame) {
  const auto recorder = open_recorder("checksums:" + path("sums.txt"));
  const Scanout first(1);
  const Scanout second(2, ScanoutDepth::Bits10);  // of another display: the same RGB
  recorder->record({.sequence = 10, .id = 4}, first.view());
  recorder->record({.sequence = 12, .id = 5, .skipped_before = 3}, second.view());
  recorder->finish();

  const std::string text = test::read_text(path("sums.txt"));
  EXPECT_EQ(text, fmt::format("# vblank frame xxh64-of-rgb\n10 4 {:016x}\n"
                              "# 3 not recorded\n12 5 {:016x}\n",
                              test::checksum_of(first.frame.view()),
                              test::checksum_of(second.frame.view())));
  EXPECT_THAT(listing(), testing::ElementsAre("sums.txt"));
}

TEST_F(Recorder, WritesTheTimeOfEachFrameAtOnce) {
  const auto recorder = open_recorder("times:" + path("times.txt"));
  const Scanout scanout(1);
  recorder->record({.sequence = 10, .id = 4, .time = std::chrono::milliseconds(167)},
                   scanout.view());
  const std::string text = test::read_text(path("times.txt"));
  EXPECT_EQ(text, fmt::format("10 4 {:016x} 167000000\n", test::checksum_of(scanout.frame.view())));
  recorder->finish();
  EXPECT_THROW((void)open_recorder("times:" + path("none/times.txt")), Error);
}

TEST_F(Recorder, ReportsTheNumberOfMissedFramesAtTheEnd) {
  const auto recorder = open_recorder("checksums:" + path("sums.txt"));
  for (int i = 0; i < 5; ++i) recorder->count_skipped();
  recorder->record({.sequence = 12, .id = 5, .skipped_before = 3}, Scanout(1).view());
  recorder->finish();
  const std::string text = test::read_text(path("sums.txt"));
  EXPECT_THAT(text, testing::HasSubstr("# 3 not recorded\n12 5"));
  EXPECT_THAT(text, testing::EndsWith("\n# 2 not recorded\n"));
  EXPECT_EQ(recorder->skipped(), 5u);
}

TEST_F(Recorder, LeavesNoUnfinishedFiles) {
  open_recorder("checksums:" + path("sums.txt"))->record({}, Scanout(1).view());
  EXPECT_THAT(listing(), testing::IsEmpty());
}

TEST_F(Recorder, WritesPicturesOfDisplayedFrames) {
  const auto recorder = open_recorder("png:" + path("shown"));
  const Scanout scanout(3);
  recorder->record({.sequence = 10, .id = 42}, scanout.view());
  recorder->finish();
  EXPECT_EQ(frames::read_woven(folder / "shown" / "00000042.png"), scanout.frame);
}

TEST_F(Recorder, RefusesInvalidPathsAndFormats) {
  const auto kind_of = [](const std::string& spec) {
    return test::error_of([&] { (void)open_recorder(spec); }).kind();
  };
  for (const char* spec : {"", "checksums", "checksums:", "png:", "film:x", "/tmp/x"})
    EXPECT_EQ(kind_of(spec), ErrorKind::Usage) << spec;
  EXPECT_EQ(kind_of("checksums:" + path("none/sums.txt")), ErrorKind::Failed);
  std::ofstream(path("file")) << "not a folder";
  EXPECT_EQ(kind_of("png:" + path("file/shown")), ErrorKind::Failed);
}

/// Simulates a full disk during its lifetime by limiting the file size of this process.
class FullDisk {
 public:
  explicit FullDisk(rlim_t largest_file) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit full{largest_file, before_.rlim_max};
    EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  }
  ~FullDisk() { setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
};

TEST_F(Recorder, WritesLinesRejectedByAFullDiskWhenSpaceIsFree) {
  const auto recorder = open_recorder("checksums:" + path("sums.txt"));
  const Scanout scanout(1);
  {
    const FullDisk full(1000);  // ends in the middle of a line
    for (uint64_t id = 0; id < 500; ++id)
      recorder->record({.sequence = id, .id = id}, scanout.view());
    EXPECT_GE(recorder->writes().state().failures, 1u);
    EXPECT_FALSE(recorder->writes().state().reason.empty());
  }
  recorder->finish();
  EXPECT_EQ(recorder->lost(), 0u);
  std::ifstream file(path("sums.txt"));
  std::string line;
  std::getline(file, line);
  for (uint64_t id = 0; id < 500; ++id) {
    ASSERT_TRUE(std::getline(file, line));
    EXPECT_EQ(line, fmt::format("{} {} {:016x}", id, id, test::checksum_of(scanout.frame.view())));
  }
  EXPECT_FALSE(std::getline(file, line));
}

TEST_F(Recorder, OnAFullDiskKeepsWholeLinesAndCountsTheRest) {
  const auto recorder = open_recorder("checksums:" + path("sums.txt"));
  const Scanout scanout(1);
  const FullDisk full(1000);
  for (uint64_t id = 0; id < 500; ++id)
    recorder->record({.sequence = id, .id = id}, scanout.view());
  EXPECT_THROW(recorder->finish(), Error);
  std::ifstream file(path("sums.txt"));
  uint64_t lines = 0;
  for (std::string line; std::getline(file, line); ++lines)
    if (lines > 0) {
      EXPECT_EQ(line, fmt::format("{} {} {:016x}", lines - 1, lines - 1,
                                  test::checksum_of(scanout.frame.view())));
    }
  EXPECT_GT(lines, 10u);
  EXPECT_EQ(recorder->lost(), 500 - (lines - 1));
}

TEST_F(Recorder, StartsOnAFullDisk) {
  const FullDisk full(0);
  const auto recorder = open_recorder("checksums:" + path("sums.txt"));
  EXPECT_EQ(recorder->writes().state().failures, 1u);
}

TEST_F(Recorder, RefusesNamesThatAreNotRegularFiles) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  for (const std::string& name : {path("pipe"), std::string("/dev/null"), folder.string()})
    for (const char* kind : {"checksums:", "times:"})
      EXPECT_THROW((void)open_recorder(kind + name), Error) << kind << name;
  EXPECT_THROW((void)open_recorder("png:" + path("pipe")), Error);
}

TEST_F(Recorder, WritesPicturesAgainWhenSpaceIsFreeAndCountsLostOnes) {
  const auto recorder = open_recorder("png:" + path("shown"));
  {
    const FullDisk full(10);
    recorder->record({.id = 1}, Scanout(1).view());
    recorder->record({.id = 2},
                     Scanout(2).view());  // skipped, since the previous frame was just refused
  }
  EXPECT_EQ(recorder->writes().state().failures, 1u);
  recorder->writes().try_at_once();
  recorder->record({.id = 3}, Scanout(3).view());
  EXPECT_EQ(recorder->lost(), 2u);
  EXPECT_TRUE(recorder->writes().state().reason.empty());
  EXPECT_EQ(frames::read_woven(folder / "shown" / "00000003.png"), Scanout(3).frame);
  EXPECT_THROW(recorder->finish(), Error) << "it is not whole";
}

TEST_F(Recorder, ReportsAtTheEndThatAPictureCouldNotBeWritten) {
  const auto recorder = open_recorder("png:" + path("shown"));
  fs::remove_all(folder / "shown");
  recorder->record({}, Scanout(1).view());
  EXPECT_THROW(recorder->finish(), Error);
}

}  // namespace
}  // namespace lenticule::display
