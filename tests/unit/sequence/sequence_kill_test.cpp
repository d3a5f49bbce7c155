// SPDX-License-Identifier: Apache-2.0
// Tests that a writer that is killed at any point loses only its unfinished frame.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <random>

#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "small_sequences.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::Content;
using test::info_of;
using test::make_frame;
using test::ScratchFolder;

constexpr FrameGeometry kGeometry{60, 40};
constexpr int kFrames = 12;

void expect_frames(const std::filesystem::path& file, uint64_t at_least) {
  const SequenceReader reader(file);
  ASSERT_GE(reader.frame_count(), at_least);
  FrameDecoder decoder = reader.make_decoder();
  WovenFrame frame(kGeometry);
  for (uint64_t n = 0; n < reader.frame_count(); ++n) {
    if (n >= at_least && n + 1 == reader.frame_count() && !decoder.check(n)) continue;
    ASSERT_TRUE(decoder.decode(n, frame.bytes())) << n;
    ASSERT_EQ(frame, make_frame(kGeometry, Content::Noise, static_cast<int>(n))) << n;
  }
}

void resume_to_the_end(const std::filesystem::path& file, uint64_t at_least) {
  SequenceWriter writer(file, info_of(kGeometry), {.resume = true, .threads = 1});
  ASSERT_GE(writer.frame_count(), at_least);
  for (auto n = static_cast<int>(writer.frame_count()); n < kFrames; ++n)
    writer.append(make_frame(kGeometry, Content::Noise, n).view());
  writer.finish();
  EXPECT_EQ(SequenceReader(file).find_damaged(), std::vector<uint64_t>());
}

/// Writes an unfinished file and returns the ends of its frames.
std::vector<uint64_t> write_unfinished(const std::filesystem::path& file) {
  SequenceWriter writer(file, info_of(kGeometry), {.threads = 1});
  std::vector<uint64_t> ends = {writer.bytes_written()};
  for (int n = 0; n < kFrames; ++n) {
    writer.append(make_frame(kGeometry, Content::Noise, n).view());
    ends.push_back(writer.bytes_written());
  }
  return ends;
}

/// Returns frames of every kind: some bands equal those of the previous frame, some contents use
/// other predictors than the contents 32 frames earlier.
WovenFrame film_frame(int n) {
  const Content content = n / 20 % 2 == 0 ? Content::Lenses : Content::Ramp;
  WovenFrame frame = make_frame(kGeometry, content, n / 4);
  if (n % 3 == 0) frame.row(kGeometry.height - 1)[5] = static_cast<uint8_t>(n);
  return frame;
}

constexpr int kFilmFrames = 75;

void write_film(const std::filesystem::path& file, int until, bool resume) {
  SequenceWriter writer(file, info_of(kGeometry), {.resume = resume, .threads = 2});
  for (auto n = static_cast<int>(writer.frame_count()); n < until; ++n)
    writer.append(film_frame(n).view());
  if (until == kFilmFrames) writer.finish();
}

TEST(SequenceKill, ResumedAfterAnyTruncationTheFileHasTheBytesOfOneRun) {
  const ScratchFolder folder;
  write_film(folder / "whole.lts", kFilmFrames, false);
  const std::vector<uint8_t> whole = test::read_bytes(folder / "whole.lts");
  const uint64_t begin =
      SequenceWriter(folder / "empty.lts", info_of(kGeometry), {.threads = 1}).bytes_written();
  std::mt19937_64 random(12);
  for (int trial = 0; trial < 150; ++trial) {
    std::vector<uint8_t> cut = whole;
    if (trial > 0) cut.resize(begin + random() % (whole.size() - begin));
    const char* name =
        trial % 2 == 0 ? "a.lts.part" : "a.lts";  // a finished file may be truncated, too
    test::write_bytes(folder / name, cut);
    write_film(folder / "a.lts", kFilmFrames, true);
    ASSERT_EQ(test::read_bytes(folder / "a.lts"), whole) << "cut at " << cut.size();
    std::filesystem::remove(folder / "a.lts");
  }
}

TEST(SequenceKill, ResumedAfterEveryFrameTheFileHasTheBytesOfOneRun) {
  const ScratchFolder folder;
  write_film(folder / "whole.lts", kFilmFrames, false);
  for (int until = 0; until <= kFilmFrames; ++until) write_film(folder / "a.lts", until, true);
  EXPECT_EQ(test::read_bytes(folder / "a.lts"), test::read_bytes(folder / "whole.lts"));
}

TEST(SequenceKill, ResumedAfterKillsTheFileHasTheBytesOfOneRun) {
  std::mt19937 random(4);
  const ScratchFolder folder;
  write_film(folder / "whole.lts", kFilmFrames, false);
  for (int trial = 0; trial < 8; ++trial) {
    for (int kills = 0; kills < 6; ++kills) {
      const pid_t child = ::fork();
      if (child == 0) {
        write_film(folder / "a.lts", kFilmFrames, true);
        _exit(0);
      }
      ASSERT_GT(child, 0);
      ::usleep(static_cast<useconds_t>(random() % 8000));
      ::kill(child, SIGKILL);
      ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    }
    write_film(folder / "a.lts", kFilmFrames, true);
    ASSERT_EQ(test::read_bytes(folder / "a.lts"), test::read_bytes(folder / "whole.lts"));
    std::filesystem::remove(folder / "a.lts");
  }
}

TEST(SequenceKill, TruncatedAnywhereKeepsEveryCompleteFrame) {
  const ScratchFolder folder;
  const std::vector<uint64_t> ends = write_unfinished(folder / "whole.lts");
  const std::vector<uint8_t> whole = test::read_bytes(folder / "whole.lts.part");
  ASSERT_EQ(whole.size(), ends.back());
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 200; ++trial) {
    // Mistakes are most likely exactly at the ends.
    const uint64_t cut = trial < kFrames + 1 ? ends[static_cast<size_t>(trial)]
                                             : ends[0] + random() % (ends.back() - ends[0] + 1);
    std::vector<uint8_t> bytes = whole;
    bytes.resize(cut);
    if (trial % 3 == 2)
      bytes.resize(cut + random() % 5000, 0);  // zeros at the end, as a power cut leaves them
    test::write_bytes(folder / "a.lts.part", bytes);
    const auto kept =
        static_cast<uint64_t>(std::upper_bound(ends.begin(), ends.end(), cut) - ends.begin()) - 1;
    expect_frames(folder / "a.lts.part", kept);
    if (trial % 10 == 0) resume_to_the_end(folder / "a.lts", kept);
  }
}

/// Appends frames until killed; writes the number of each finished one to the pipe.
[[noreturn]] void write_until_killed(const std::filesystem::path& file, int pipe) {
  SequenceWriter writer(file, info_of(kGeometry), {.resume = true, .threads = 1});
  for (auto n = static_cast<int>(writer.frame_count()); n < kFrames; ++n) {
    writer.append(make_frame(kGeometry, Content::Noise, n).view());
    const char reported = 1;
    if (::write(pipe, &reported, 1) != 1) _exit(2);
  }
  writer.finish();
  _exit(0);
}

TEST(SequenceKill, KilledWritersLoseOnlyTheUnfinishedFrame) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 40; ++trial) {
    const ScratchFolder folder;
    int pipe[2];
    ASSERT_EQ(::pipe(pipe), 0);
    const pid_t child = ::fork();
    if (child == 0) write_until_killed(folder / "a.lts", pipe[1]);
    ASSERT_GT(child, 0);
    ::close(pipe[1]);
    uint64_t reported = 0;
    char byte = 0;
    const auto enough = 1 + random() % (kFrames - 1);
    while (reported < enough && ::read(pipe[0], &byte, 1) == 1) ++reported;
    ::usleep(static_cast<useconds_t>(random() % 600));
    ::kill(child, SIGKILL);
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    ::close(pipe[0]);
    EXPECT_EQ(reported, enough);
    if (std::filesystem::exists(folder / "a.lts.part"))
      expect_frames(folder / "a.lts.part", reported);
    resume_to_the_end(folder / "a.lts", reported);
  }
}

}  // namespace
}  // namespace lenticule::frames
