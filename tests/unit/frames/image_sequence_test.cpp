// SPDX-License-Identifier: Apache-2.0
// Tests that a sequence plays in order, without a gap at the loop point, from a pool of bounded
// size.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <deque>
#include <optional>

#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/little_memory.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using test::ScratchFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Writes frames whose every byte is their number.
void write_numbered(const ScratchFolder& folder, int count, int first = 0) {
  for (int n = first; n < first + count; ++n) {
    WovenFrame frame({.width = 8, .height = 4});
    std::fill(frame.bytes().begin(), frame.bytes().end(), static_cast<uint8_t>(n));
    write_woven(frame.view(), FilePattern((folder / "%03d.png").string()).path(uint64_t(n)));
  }
}

std::vector<std::filesystem::path> files_in(const ScratchFolder& folder) {
  return list_frame_files((folder / "%03d.png").string());
}

void wait_for_wake(ImageSequence& sequence) {
  pollfd wake{.fd = sequence.wake_fd(), .events = POLLIN, .revents = 0};
  ASSERT_EQ(::poll(&wake, 1, 10000), 1) << "no wake-up";
  sequence.service();
}

/// Waits for a frame or for the end of the sequence, as a player does.
PullStatus pull_waiting(ImageSequence& sequence, AcquiredFrame& out) {
  PullStatus status = sequence.pull(out);
  while (status == PullStatus::NotYet && !::testing::Test::HasFatalFailure()) {
    wait_for_wake(sequence);
    status = sequence.pull(out);
  }
  return status;
}

void wait_until_saturated(ImageSequence& sequence) {
  while (!sequence.saturated() && !::testing::Test::HasFatalFailure()) wait_for_wake(sequence);
}

bool holds_its_number(const AcquiredFrame& acquired) {
  return std::all_of(acquired.frame.bytes.begin(), acquired.frame.bytes.end(),
                     [&](uint8_t byte) { return byte == acquired.number; });
}

struct PoolCase {
  int files;
  int pool;
  int threads;
};
class SequencePool : public ::testing::TestWithParam<PoolCase> {};

TEST_P(SequencePool, PlaysManyLoopsInOrderWhileFramesAreHeld) {
  const auto [files, pool, threads] = GetParam();
  const ScratchFolder folder;
  write_numbered(folder, files);
  ImageSequence sequence(files_in(folder), {.pool_frames = pool, .decoder_threads = threads});
  const size_t held_at_most = std::min<size_t>(3, static_cast<size_t>(sequence.max_acquired()));
  ASSERT_GE(held_at_most, 1u);

  std::deque<AcquiredFrame> held;
  for (int round = 0; round < 20; ++round) {
    for (int n = 0; n < files; ++n) {
      if (held.size() == held_at_most) {
        EXPECT_TRUE(holds_its_number(held.front())) << "changed while lent";
        sequence.release(held.front().token);
        held.pop_front();
      }
      AcquiredFrame acquired;
      ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
      ASSERT_EQ(acquired.number, static_cast<uint64_t>(n));
      ASSERT_TRUE(holds_its_number(acquired));
      held.push_back(acquired);
    }
    AcquiredFrame none;
    ASSERT_EQ(sequence.pull(none), PullStatus::End);
    ASSERT_EQ(sequence.pull(none), PullStatus::End) << "the end lasts until rewind";
    ASSERT_TRUE(sequence.rewind());
  }
  EXPECT_EQ(sequence.failure(), "");
}
INSTANTIATE_TEST_SUITE_P(Sizes, SequencePool,
                         ::testing::Values(PoolCase{1, 4, 1}, PoolCase{3, 8, 1}, PoolCase{5, 2, 1},
                                           PoolCase{5, 3, 2}, PoolCase{7, 4, 3}, PoolCase{4, 4, 2},
                                           PoolCase{2, 1, 1}));

#if LENTICULE_LIMITS_MEMORY
TEST(ImageSequence, DecodesWithTheThreadsThatTheSystemAllows) {
  const ScratchFolder folder;
  write_numbered(folder, 100);
  std::optional<ImageSequence> sequence;
  {
    const test::LittleMemory limit(test::kFewStacks);
    sequence.emplace(files_in(folder), ImageSequenceOptions{.decoder_threads = 64});
  }
  AcquiredFrame acquired;
  for (int n = 0; n < 100; ++n) {
    ASSERT_EQ(pull_waiting(*sequence, acquired), PullStatus::Ready);
    EXPECT_TRUE(holds_its_number(acquired));
    sequence->release(acquired.token);
  }
}
#endif

TEST(ImageSequence, ReportsItsGeometryAndLength) {
  const ScratchFolder folder;
  write_numbered(folder, 3);
  const ImageSequence sequence(files_in(folder), {.rate = Rate{24000, 1001}});
  EXPECT_EQ(sequence.geometry(), (FrameGeometry{.width = 8, .height = 4}));
  EXPECT_EQ(sequence.frame_count(), 3u);
  EXPECT_EQ(sequence.rate(), (Rate{24000, 1001}));
}

TEST(ImageSequence, TheNextLoopIsReadyBeforeTheEnd) {
  const ScratchFolder folder;
  write_numbered(folder, 6);
  ImageSequence sequence(files_in(folder), {.pool_frames = 4});
  AcquiredFrame acquired;
  for (int n = 0; n < 6; ++n) {
    ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
    sequence.release(acquired.token);
  }
  wait_until_saturated(sequence);
  EXPECT_EQ(sequence.ready_count(), 4u);
  ASSERT_EQ(sequence.pull(acquired), PullStatus::End);
  ASSERT_TRUE(sequence.rewind());
  // Pulling does not wait: the loop point is no slower than any other frame.
  ASSERT_EQ(sequence.pull(acquired), PullStatus::Ready);
  EXPECT_EQ(acquired.number, 0u);
}

TEST(ImageSequence, DecodesNoFurtherThanItsPool) {
  const ScratchFolder folder;
  write_numbered(folder, 10);
  ImageSequence sequence(files_in(folder), {.pool_frames = 3, .decoder_threads = 2});
  wait_until_saturated(sequence);
  EXPECT_EQ(sequence.ready_count(), 3u);
  AcquiredFrame acquired;
  ASSERT_EQ(sequence.pull(acquired), PullStatus::Ready);
  EXPECT_TRUE(sequence.saturated()) << "a lent frame is still in the pool";
  EXPECT_EQ(sequence.ready_count(), 2u);
  sequence.release(acquired.token);
  wait_until_saturated(sequence);
  EXPECT_EQ(sequence.ready_count(), 3u);
}

TEST(ImageSequence, IsReadOnceIfItFitsIntoThePool) {
  const ScratchFolder folder;
  write_numbered(folder, 3);
  const auto files = files_in(folder);
  ImageSequence sequence(files, {.pool_frames = 3});
  wait_until_saturated(sequence);
  for (const auto& file : files) std::filesystem::remove(file);
  AcquiredFrame acquired;
  for (int n = 0; n < 30; ++n) {
    ASSERT_EQ(sequence.pull(acquired), PullStatus::Ready);
    EXPECT_TRUE(holds_its_number(acquired));
    if (n % 3 == 2) {
      ASSERT_EQ(sequence.pull(acquired), PullStatus::End);
      ASSERT_TRUE(sequence.rewind());
    }
  }
}

TEST(ImageSequence, RewindsOnlyAtTheStartOrEnd) {
  const ScratchFolder folder;
  write_numbered(folder, 2);
  ImageSequence sequence(files_in(folder));
  EXPECT_TRUE(sequence.rewind()) << "at the start it is there already";
  AcquiredFrame acquired;
  ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
  EXPECT_FALSE(sequence.rewind());
  ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
  EXPECT_EQ(acquired.number, 1u);
}

TEST(ImageSequence, AnUnreadableFrameFailsWhenItIsDue) {
  const ScratchFolder folder;
  write_numbered(folder, 5);
  auto bytes = test::read_bytes(folder / "003.png");
  bytes.resize(bytes.size() / 2);
  test::write_bytes(folder / "003.png", bytes);
  ImageSequence sequence(files_in(folder), {.pool_frames = 4, .decoder_threads = 3});
  AcquiredFrame acquired;
  for (int n = 0; n < 3; ++n) {
    ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
    EXPECT_EQ(acquired.number, static_cast<uint64_t>(n));
    EXPECT_EQ(sequence.failure(), "");
    sequence.release(acquired.token);
  }
  EXPECT_EQ(pull_waiting(sequence, acquired), PullStatus::Failed);
  EXPECT_EQ(pull_waiting(sequence, acquired), PullStatus::Failed);
  EXPECT_THAT(sequence.failure(), HasSubstr("003.png: truncated"));
}

TEST(ImageSequence, AFrameOfAnotherSizeFails) {
  const ScratchFolder folder;
  write_numbered(folder, 2);
  write_woven(WovenFrame({.width = 4, .height = 8}).view(), folder / "002.png");
  ImageSequence sequence(files_in(folder));
  AcquiredFrame acquired;
  ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
  ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
  EXPECT_EQ(pull_waiting(sequence, acquired), PullStatus::Failed);
  EXPECT_THAT(sequence.failure(), HasSubstr("002.png: 4 x 8 pixels where 8 x 4 are expected"));
}

TEST(ImageSequence, AFirstFileThatIsNotAPictureIsRefusedAtOnce) {
  const ScratchFolder folder;
  test::write_bytes(folder / "000.png", {1, 2, 3});
  EXPECT_EQ(error_of([&] { ImageSequence sequence(files_in(folder)); }).kind(), ErrorKind::Input);
  EXPECT_EQ(error_of([&] { ImageSequence sequence({folder / "none.png"}); }).kind(),
            ErrorKind::Input);
  const std::vector<std::filesystem::path> none;
  EXPECT_EQ(error_of([&] { ImageSequence sequence(none); }).kind(), ErrorKind::Input);
}

TEST(ImageSequence, CanBeDestroyedAtAnyTime) {
  const ScratchFolder folder;
  write_numbered(folder, 4);
  for (int n = 0; n < 20; ++n) {
    ImageSequence sequence(files_in(folder), {.pool_frames = 2, .decoder_threads = 3});
    AcquiredFrame acquired;
    if (n % 2 == 1) {
      ASSERT_EQ(pull_waiting(sequence, acquired), PullStatus::Ready);
    }
  }
}

TEST(FrameFiles, StartAtTheFirstNumber) {
  const ScratchFolder folder;
  write_numbered(folder, 2, 7);
  EXPECT_THAT(files_in(folder), ElementsAre(folder / "007.png", folder / "008.png"));
  EXPECT_THAT(list_frame_files("still.png"), ElementsAre("still.png"));
}

TEST(FrameFiles, AMissingFrameIsNamed) {
  const ScratchFolder folder;
  write_numbered(folder, 4);
  std::filesystem::remove(folder / "002.png");
  const Error hole = error_of([&] { (void)files_in(folder); });
  EXPECT_EQ(hole.kind(), ErrorKind::Input);
  EXPECT_THAT(hole.what(), HasSubstr("002.png: missing"));
  EXPECT_THAT(error_of([&] { (void)list_frame_files((folder / "x%d.png").string()); }).what(),
              HasSubstr("no such files"));
  EXPECT_THAT(error_of([&] { (void)list_frame_files((folder / "%05d.png").string()); }).hint(),
              HasSubstr("%03d.png"));
}

}  // namespace
}  // namespace lenticule::frames
