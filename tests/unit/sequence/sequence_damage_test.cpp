// SPDX-License-Identifier: Apache-2.0
// Damages every single byte of a file: the damage is detected, costs only the frames that need the
// byte, and never shows a wrong picture.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <set>

#include "frames/sequence/sequence_format.h"
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

constexpr FrameGeometry kGeometry{9, 12};
constexpr int kFrames = 4;

struct Played {
  std::vector<int> numbers;  ///< numbers of the pictures shown
  uint64_t damaged = 0;
};

int number_of(const FrameView& shown) {
  for (int n = 0; n < kFrames; ++n) {
    const WovenFrame frame = make_frame(kGeometry, Content::Noise, n);
    if (std::equal(shown.bytes.begin(), shown.bytes.end(), frame.bytes().begin())) return n;
  }
  return -1;
}

Played play(const std::filesystem::path& file) {
  SequenceSource source(file, {.pool_frames = 8});
  Played played;
  AcquiredFrame acquired;
  PullStatus status = source.pull(acquired);
  for (; status != PullStatus::End && status != PullStatus::Failed;
       status = source.pull(acquired)) {
    if (status == PullStatus::Ready) {
      played.numbers.push_back(number_of(acquired.frame));
      source.release(acquired.token);
      continue;
    }
    pollfd wake{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
    if (::poll(&wake, 1, 10000) != 1) break;
    source.service();
  }
  played.damaged = source.damage().damaged;
  return played;
}

/// Returns the pictures to be shown when these frames are lost.
std::vector<int> with_replacements(const std::set<int>& lost) {
  std::vector<int> numbers;
  for (int n = 0; n < kFrames; ++n) {
    int shown = n;
    while (shown >= 0 && lost.count(shown) != 0) --shown;
    for (int later = n; shown < 0; ++later) shown = lost.count(later) != 0 ? -1 : later;
    numbers.push_back(shown);
  }
  return numbers;
}

class SpoiltByte : public ::testing::TestWithParam<uint8_t> {};

TEST_P(SpoiltByte, IsDetectedAndItsFrameReplaced) {
  const ScratchFolder folder;
  test::write_sequence(folder / "good.lts", kGeometry, Content::Noise, kFrames);
  const std::vector<uint8_t> good = test::read_bytes(folder / "good.lts");
  const std::string metadata = sequence_info_to_json(info_of(kGeometry));
  const size_t data_begin = kFileHeaderBytes + metadata.size();
  const size_t index_begin = good.size() - kTrailerBytes - 8 * kFrames;
  const size_t record = (index_begin - data_begin) / kFrames;
  // Written in place, since truncating and rewriting a file waits for the disk.
  const UniqueFd file(::open((folder / "good.lts").c_str(), O_RDWR | O_CLOEXEC));
  for (size_t i = 0; i < good.size(); ++i) {
    const auto spoilt = static_cast<uint8_t>(good[i] ^ GetParam());
    if (i > 0) {
      ASSERT_TRUE(write_at(file.get(), i - 1, std::span(good).subspan(i - 1, 1)));
    }
    ASSERT_TRUE(write_at(file.get(), i, {&spoilt, 1}));
    if (i < data_begin) {
      EXPECT_THROW(SequenceReader(folder / "good.lts"), Error) << i;
      continue;
    }
    const bool in_index = i >= index_begin;
    std::set<int> lost;
    if (!in_index) lost.insert(static_cast<int>((i - data_begin) / record));
    const Played played = play(folder / "good.lts");
    ASSERT_EQ(played.numbers, with_replacements(lost)) << "byte " << i;
    ASSERT_EQ(played.damaged, lost.size()) << "byte " << i;
    ASSERT_EQ(SequenceReader(folder / "good.lts").has_index(), !in_index) << "byte " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Bits, SpoiltByte, ::testing::Values(0x01, 0x80, 0xff));

TEST(SequenceDamage, FindsFramesBehindTheDamageWithoutAnIndex) {
  const ScratchFolder folder;
  std::vector<uint64_t> ends;
  {
    SequenceWriter writer(folder / "a.lts", info_of(kGeometry), {.threads = 1});
    for (int n = 0; n < kFrames; ++n) {
      ends.push_back(writer.bytes_written());
      writer.append(make_frame(kGeometry, Content::Noise, n).view());
    }
  }
  std::vector<uint8_t> bytes = test::read_bytes(folder / "a.lts.part");
  bytes[ends[1] + 5] ^= 0x40;  // damages the header of frame 1
  test::write_bytes(folder / "a.lts.part", bytes);
  const Played played = play(folder / "a.lts.part");
  EXPECT_EQ(played.numbers, (std::vector<int>{0, 0, 2, 3}));
  EXPECT_EQ(played.damaged, 1u);
  // A writer continues before the damage.
  SequenceWriter writer(folder / "a.lts", info_of(kGeometry), {.resume = true, .threads = 1});
  EXPECT_EQ(writer.frame_count(), 1u);
}

TEST(SequenceDamage, AFileWithoutAReadableFrameFails) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Noise, kFrames);
  std::vector<uint8_t> bytes = test::read_bytes(folder / "a.lts");
  const size_t begin = kFileHeaderBytes + sequence_info_to_json(info_of(kGeometry)).size();
  const size_t end = bytes.size() - kTrailerBytes - 8 * kFrames;
  for (size_t i = begin; i < end; ++i) bytes[i] = 0;
  test::write_bytes(folder / "a.lts", bytes);
  SequenceSource source(folder / "a.lts", {.pool_frames = 2});
  AcquiredFrame acquired;
  PullStatus status = source.pull(acquired);
  while (status == PullStatus::NotYet) {
    pollfd wake{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
    ASSERT_EQ(::poll(&wake, 1, 10000), 1);
    source.service();
    status = source.pull(acquired);
  }
  EXPECT_EQ(status, PullStatus::Failed);
  EXPECT_THAT(source.failure(), ::testing::HasSubstr("frame 0"));
}

TEST(SequenceDamage, RefusesAFileWithoutFrames) {
  const ScratchFolder folder;
  test::write_sequence(folder / "a.lts", kGeometry, Content::Noise, 0);
  const Error error = test::error_of([&] { SequenceSource(folder / "a.lts"); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.hint(), ::testing::HasSubstr("it ends within its first frame"));
}

}  // namespace
}  // namespace lenticule::frames
