// SPDX-License-Identifier: Apache-2.0
// Tests that a container plays in order, without a gap at its loop points, from a pool of bounded
// size.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <deque>
#include <filesystem>

#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "small_sequences.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::Content;
using test::info_of;
using test::make_frame;
using test::ScratchFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr FrameGeometry kGeometry{8, 4};

PullStatus pull_waiting(SequenceSource& source, AcquiredFrame& out) {
  PullStatus status = source.pull(out);
  while (status == PullStatus::NotYet) {
    pollfd wake{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
    if (::poll(&wake, 1, 10000) != 1) {
      ADD_FAILURE() << "no wake-up";
      return PullStatus::Failed;
    }
    source.service();
    status = source.pull(out);
  }
  return status;
}

/// Returns the numbers of one loop's frames, counted from frame `begin` of the file, each checked
/// against the pixels.
std::vector<uint64_t> play_round(SequenceSource& source, uint64_t begin = 0) {
  std::vector<uint64_t> numbers;
  AcquiredFrame acquired;
  while (pull_waiting(source, acquired) == PullStatus::Ready) {
    const auto flat = static_cast<uint8_t>(10 * (begin + acquired.number) + 3);
    EXPECT_TRUE(std::all_of(acquired.frame.bytes.begin(), acquired.frame.bytes.end(),
                            [&](uint8_t byte) { return byte == flat; }));
    numbers.push_back(acquired.number);
    source.release(acquired.token);
  }
  return numbers;
}

struct PoolCase {
  int frames;
  int pool;
  int threads;
};
class SequenceLoops : public ::testing::TestWithParam<PoolCase> {};

TEST_P(SequenceLoops, TenThousandLoopsAreTheExactSequence) {
  const auto [frames, pool, threads] = GetParam();
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, frames);
  SequenceSource source(folder / "a.lts", {.pool_frames = pool, .decoder_threads = threads});
  std::vector<uint64_t> expected(static_cast<size_t>(frames));
  for (size_t n = 0; n < expected.size(); ++n) expected[n] = n;
  for (int round = 0; round < 10000; ++round) {
    ASSERT_EQ(play_round(source), expected) << round;
    ASSERT_TRUE(source.rewind());
  }
  EXPECT_EQ(source.damage().damaged, 0u);
}

INSTANTIATE_TEST_SUITE_P(Pools, SequenceLoops,
                         ::testing::Values(PoolCase{3, 2, 1}, PoolCase{5, 3, 2}, PoolCase{3, 8, 2},
                                           PoolCase{1, 2, 1}));

TEST(SequenceSource, KeepsAcquiredFramesWhileItDecodesFurther) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, 20);
  SequenceSource source(folder / "a.lts", {.pool_frames = 5, .decoder_threads = 3});
  std::deque<AcquiredFrame> held;
  AcquiredFrame acquired;
  for (int n = 0; n < 60; ++n) {
    if (pull_waiting(source, acquired) == PullStatus::End) {
      ASSERT_TRUE(source.rewind());
      ASSERT_EQ(pull_waiting(source, acquired), PullStatus::Ready);
    }
    held.push_back(acquired);
    for (const AcquiredFrame& frame : held)
      ASSERT_EQ(frame.frame.bytes[7], static_cast<uint8_t>(10 * frame.number + 3));
    if (held.size() < static_cast<size_t>(source.max_acquired())) continue;
    source.release(held.front().token);
    held.pop_front();
  }
}

TEST(SequenceSource, PlaysTheIntroductionOnceAndThenTheLoop) {
  const ScratchFolder folder;
  SequenceInfo info = info_of(kGeometry);
  info.loop_begin = 2;
  info.loop_end = 5;
  SequenceWriter writer(folder / "a.lts", info, {.threads = 1});
  for (int n = 0; n < 7; ++n) writer.append(make_frame(kGeometry, Content::Flat, n).view());
  writer.finish();
  for (const int pool : {2, 16}) {
    SequenceSource source(folder / "a.lts", {.pool_frames = pool});
    EXPECT_THAT(play_round(source), ElementsAre(0, 1, 2, 3, 4));
    for (int round = 0; round < 5; ++round) {
      ASSERT_TRUE(source.rewind());
      EXPECT_THAT(play_round(source), ElementsAre(2, 3, 4));
    }
  }
}

TEST(SequenceSource, CountsTheFramesOfARangeFromItsStart) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, 9);
  SequenceSource source(folder / "a.lts", {.pool_frames = 2, .begin = 3, .end = 6});
  EXPECT_EQ(source.frame_count(), 3u);
  EXPECT_EQ(source.rate(), make_rate(24000, 1001));
  for (int round = 0; round < 3; ++round) {
    EXPECT_THAT(play_round(source, 3), ElementsAre(0, 1, 2));
    ASSERT_TRUE(source.rewind());
  }
  const Error error =
      test::error_of([&] { SequenceSource(folder / "a.lts", {.begin = 3, .end = 10}); });
  EXPECT_THAT(error.what(), HasSubstr("has frames 0 to 8"));
}

TEST(SequenceSource, RewindsOnlyAtTheStartOrEnd) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, 3);
  SequenceSource source(folder / "a.lts", {.pool_frames = 2});
  EXPECT_TRUE(source.rewind());
  AcquiredFrame acquired;
  ASSERT_EQ(pull_waiting(source, acquired), PullStatus::Ready);
  EXPECT_FALSE(source.rewind());
  source.release(acquired.token);
}

TEST(SequenceSource, ContinuesWithTheRemainingFramesIfTheFileIsTruncated) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, 40);
  const SequenceReader layout(folder / "a.lts");
  SequenceSource source(folder / "a.lts", {.pool_frames = 2});
  ASSERT_EQ(::truncate((folder / "a.lts").c_str(), static_cast<off_t>(layout.file_bytes() / 2)), 0);
  AcquiredFrame acquired;
  int shown = 0;
  while (pull_waiting(source, acquired) == PullStatus::Ready) {
    ++shown;
    source.release(acquired.token);
  }
  EXPECT_EQ(shown, 40);
  EXPECT_GT(source.damage().damaged, 10u);
}

/// Returns the damage that is known of a file as soon as it is open.
FrameDamage damage_of(const std::filesystem::path& file, SequenceSourceOptions options = {}) {
  return SequenceSource(file, options).damage();
}

TEST(SequenceSource, CountsAtLeastOneMissingFrameIfTheFileWasCut) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, 9);
  const std::vector<uint8_t> whole = test::read_bytes(folder / "a.lts");
  EXPECT_EQ(damage_of(folder / "a.lts").missing, 0u);
  const size_t index_begin = whole.size() - kTrailerBytes - 9 * 8;
  for (const size_t cut : {index_begin / 2, index_begin - 1, index_begin}) {
    test::write_bytes(folder / "a.lts", {whole.begin(), whole.begin() + std::ptrdiff_t(cut)});
    EXPECT_EQ(damage_of(folder / "a.lts").missing, 1u) << cut;
    EXPECT_EQ(damage_of(folder / "a.lts", {.end = 2}).missing, 0u) << "the range is complete";
    std::filesystem::copy(folder / "a.lts", folder / "a.lts.part",
                          std::filesystem::copy_options::overwrite_existing);
    EXPECT_EQ(damage_of(folder / "a.lts.part").missing, 0u) << "an unfinished file is not cut";
  }
}

TEST(SequenceSource, CountsNoMissingFrameIfOnlyTheIndexWasCutOrDamaged) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Flat, 9);
  const std::vector<uint8_t> whole = test::read_bytes(folder / "a.lts");
  const size_t index_begin = whole.size() - kTrailerBytes - 9 * 8;
  for (size_t cut = index_begin + 8; cut < whole.size(); ++cut) {
    test::write_bytes(folder / "a.lts", {whole.begin(), whole.begin() + std::ptrdiff_t(cut)});
    EXPECT_EQ(damage_of(folder / "a.lts"), FrameDamage{}) << cut;
  }
  std::vector<uint8_t> damaged = whole;
  damaged[index_begin] ^= 1;
  test::write_bytes(folder / "a.lts", damaged);
  EXPECT_EQ(damage_of(folder / "a.lts"), FrameDamage{});
}

TEST(SequenceSource, CountsTheFramesThatACutFileLacksOfItsLoop) {
  const ScratchFolder folder;
  SequenceInfo info = info_of(kGeometry);
  info.loop_end = 7;
  SequenceWriter writer(folder / "a.lts", info, {.threads = 1});
  uint64_t end_of_third = 0;
  for (int n = 0; n < 7; ++n) {
    writer.append(make_frame(kGeometry, Content::Flat, n).view());
    if (n == 2) end_of_third = writer.bytes_written();
  }
  writer.finish();
  std::filesystem::resize_file(folder / "a.lts", end_of_third + 1);
  EXPECT_EQ(damage_of(folder / "a.lts").missing, 4u);
}

TEST(SequenceSource, CanBeDestroyedAtAnyTime) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", {400, 300}, Content::Noise, 6);
  for (int i = 0; i < 30; ++i) {
    SequenceSource source(folder / "a.lts", {.pool_frames = 3, .decoder_threads = 4});
    if (i % 3 == 0) continue;
    AcquiredFrame acquired;
    EXPECT_EQ(pull_waiting(source, acquired), PullStatus::Ready);
  }
}

}  // namespace
}  // namespace lenticule::frames
