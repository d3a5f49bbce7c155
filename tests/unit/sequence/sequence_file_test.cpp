// SPDX-License-Identifier: Apache-2.0
// Tests that written frames are read back: any size, any frame, any order, after any number of
// resumed runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <new>

#include "base/file.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "small_sequences.h"
#include "tests/support/error_matchers.h"
#include "tests/support/little_memory.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::Content;
using test::error_of;
using test::info_of;
using test::make_frame;
using test::ScratchFolder;
using test::write_sequence;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr FrameGeometry kSmall{40, 20};

void expect_frame(const SequenceReader& reader, uint64_t number, const WovenFrame& expected) {
  FrameDecoder decoder = reader.make_decoder();
  WovenFrame frame(reader.geometry());
  ASSERT_TRUE(decoder.decode(number, frame.bytes())) << number;
  EXPECT_EQ(frame, expected) << number;
}

TEST(SequenceFile, RoundTripsOddSizesInAnyOrder) {
  const ScratchFolder folder;
  for (const FrameGeometry geometry :
       {FrameGeometry{1, 1}, FrameGeometry{7, 3}, FrameGeometry{33, 41}, FrameGeometry{641, 77}}) {
    for (const Content content : {Content::Noise, Content::Flat, Content::Ramp, Content::Lenses}) {
      write_sequence(folder / "a.lts", geometry, content, 4);
      const SequenceReader reader(folder / "a.lts");
      EXPECT_TRUE(reader.has_index());
      EXPECT_EQ(reader.info(), info_of(geometry));
      ASSERT_EQ(reader.frame_count(), 4u);
      for (const int n : {2, 0, 3, 1, 0})
        expect_frame(reader, static_cast<uint64_t>(n), make_frame(geometry, content, n));
    }
  }
}

TEST(SequenceFile, UnchangedBandsAreStoredOnce) {
  const ScratchFolder folder;
  const WovenFrame still = make_frame({200, 144}, Content::Noise, 1);
  WovenFrame moved = still;
  moved.row(100)[30] ^= 1;
  SequenceWriter writer(folder / "a.lts", info_of(still.geometry()), {.threads = 2});
  writer.append(still.view());
  const uint64_t once = writer.bytes_written();
  for (int n = 0; n < 10; ++n) writer.append(still.view());
  EXPECT_LT(writer.bytes_written(), once + 10 * 1000);
  writer.append(moved.view());
  EXPECT_LT(writer.bytes_written(), once + 11 * 1000 + once / 10);
  writer.append(still.view());
  writer.finish();
  const SequenceReader reader(folder / "a.lts");
  for (uint64_t n = 0; n < 13; ++n) expect_frame(reader, n, n == 11 ? moved : still);
}

#if LENTICULE_LIMITS_MEMORY
TEST(SequenceFile, MayRetryAfterAFrameThatDidNotFitInMemory) {
  const ScratchFolder folder;
  const WovenFrame black({.width = 1920, .height = 1080});
  WovenFrame noise = black;
  uint32_t state = 1;
  for (uint8_t& byte : noise.bytes()) {
    state = state * 1664525 + 1013904223;
    byte = static_cast<uint8_t>(state >> 24);
  }
  SequenceWriter writer(folder / "a.lts", info_of(black.geometry()), {.threads = 1});
  writer.append(black.view());
  {
    const test::LittleMemory limit(2);
    EXPECT_THROW(writer.append(noise.view()), std::bad_alloc);
  }
  writer.append(black.view());
  writer.finish();
  const SequenceReader reader(folder / "a.lts");
  EXPECT_EQ(reader.frame_count(), 2u);
  for (const uint64_t n : {0, 1}) expect_frame(reader, n, black);
}
#endif

TEST(SequenceFile, IsNamedPartUntilFinished) {
  const ScratchFolder folder;
  SequenceWriter writer(folder / "a.lts", info_of(kSmall), {.threads = 1});
  writer.append(make_frame(kSmall, Content::Ramp, 0).view());
  EXPECT_FALSE(std::filesystem::exists(folder / "a.lts"));
  const SequenceReader growing(folder / "a.lts.part");
  EXPECT_FALSE(growing.has_index());
  EXPECT_EQ(growing.frame_count(), 1u);
  writer.append(make_frame(kSmall, Content::Ramp, 1).view());
  writer.finish();
  EXPECT_EQ(folder.entries(), 1u);
  EXPECT_EQ(SequenceReader(folder / "a.lts").frame_count(), 2u);
}

TEST(SequenceFile, KeepsTheOldFileUntilTheNewOneIsFinished) {
  const ScratchFolder folder;
  write_sequence(folder / "a.lts", kSmall, Content::Ramp, 3);
  SequenceWriter writer(folder / "a.lts", info_of(kSmall), {.threads = 1});
  EXPECT_EQ(SequenceReader(folder / "a.lts").frame_count(), 3u);
  writer.finish();
  EXPECT_EQ(SequenceReader(folder / "a.lts").frame_count(), 0u);
}

TEST(SequenceFile, ResumesAfterTheLastFrame) {
  const ScratchFolder folder;
  for (int sitting = 0; sitting < 4; ++sitting) {
    SequenceWriter writer(folder / "a.lts", info_of(kSmall), {.resume = true, .threads = 1});
    ASSERT_EQ(writer.frame_count(), static_cast<uint64_t>(2 * sitting));
    for (int n = 2 * sitting; n < 2 * sitting + 2; ++n)
      writer.append(make_frame(kSmall, Content::Noise, n).view());
    if (sitting % 2 == 1) writer.finish();
  }
  const SequenceReader reader(folder / "a.lts");
  ASSERT_EQ(reader.frame_count(), 8u);
  for (uint64_t n = 0; n < 8; ++n)
    expect_frame(reader, n, make_frame(kSmall, Content::Noise, static_cast<int>(n)));
  EXPECT_THAT(reader.find_damaged(), IsEmpty());
}

TEST(SequenceFile, KeepsAStatedErrorOverResumedRuns) {
  const ScratchFolder folder;
  constexpr FrameGeometry kGrain{200, 144};
  SequenceInfo info = info_of(kGrain);
  info.max_error = 2;
  for (int first = 0; first < 6; first += 2) {
    SequenceWriter writer(folder / "a.lts", info, {.resume = true, .threads = 2, .max_error = 2});
    for (int n = first; n < first + 2; ++n)
      writer.append(make_frame(kGrain, Content::Grain, n).view());
    writer.finish();
  }
  const SequenceReader reader(folder / "a.lts");
  EXPECT_EQ(reader.info().max_error, 2);
  ASSERT_EQ(reader.frame_count(), 6u);
  FrameDecoder decoder = reader.make_decoder();
  WovenFrame frame(kGrain);
  int largest = 0;
  for (int n = 0; n < 6; ++n) {
    const WovenFrame original = make_frame(kGrain, Content::Grain, n);
    ASSERT_TRUE(decoder.decode(static_cast<uint64_t>(n), frame.bytes()));
    for (size_t at = 0; at < frame.bytes().size(); ++at)
      largest = std::max(largest, std::abs(frame.bytes()[at] - original.bytes()[at]));
  }
  EXPECT_EQ(largest, 2) << "0 would mean that nothing was saved";
  EXPECT_THAT(error_of([&] {
                SequenceWriter(folder / "a.lts", info_of(kGrain), {.resume = true, .threads = 1});
              }).what(),
              HasSubstr("another largest error"));
}

TEST(SequenceFile, RefusesToResumeAnotherSequence) {
  const ScratchFolder folder;
  write_sequence(folder / "a.lts", kSmall, Content::Ramp, 1);
  const auto continue_with = [&](const SequenceInfo& info) {
    return error_of(
        [&] { SequenceWriter(folder / "a.lts", info, {.resume = true, .threads = 1}); });
  };
  SequenceInfo other = info_of(kSmall);
  other.rig_fingerprint = "fedcba9876543210";
  EXPECT_THAT(continue_with(other).what(), HasSubstr("another rig"));
  other = info_of(kSmall);
  other.made_from = "another.nff";
  EXPECT_THAT(continue_with(other).what(), HasSubstr("another scene"));
  other = info_of(kSmall);
  other.rate = make_rate(25, 1);
  EXPECT_THAT(continue_with(other).what(), HasSubstr("another frame rate"));
  EXPECT_THAT(continue_with(info_of({40, 21})).what(), HasSubstr("another frame size"));
  EXPECT_EQ(continue_with(info_of({40, 21})).kind(), ErrorKind::Input);
  EXPECT_EQ(SequenceReader(folder / "a.lts").frame_count(), 1u) << "refused, but not left alone";
}

TEST(SequenceFile, AllowsOnlyOneWriterAtATime) {
  const ScratchFolder folder;
  SequenceWriter writer(folder / "a.lts", info_of(kSmall), {.threads = 1});
  for (const bool resume : {false, true}) {
    const Error error = error_of([&] {
      SequenceWriter(folder / "a.lts", info_of(kSmall), {.resume = resume, .threads = 1});
    });
    EXPECT_THAT(error.what(), HasSubstr("another process is writing it"));
  }
}

TEST(SequenceFile, RefusesFilesThatAreNotSequences) {
  const ScratchFolder folder;
  EXPECT_EQ(error_of([&] { SequenceReader(folder / "missing.lts"); }).kind(), ErrorKind::Input);
  EXPECT_EQ(error_of([&] { SequenceReader{folder.path()}; }).kind(), ErrorKind::Input);
  test::write_bytes(folder / "empty.lts", {});
  EXPECT_THAT(error_of([&] { SequenceReader(folder / "empty.lts"); }).what(),
              HasSubstr("empty.lts: empty"));
  for (const auto& [content, what] :
       {std::pair("<html>", "a page of the web"),
        {"404: Not Found", "a text, not the file"},
        {"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS"},
        {"\x89LTS\r\n\x1a", "the file ends within its header"},
        {"\x01\x02", "not a sequence container"}}) {
    write_text_file(folder / "b.lts", content);
    EXPECT_THAT(error_of([&] { SequenceReader(folder / "b.lts"); }).what(), HasSubstr(what));
  }
  EXPECT_EQ(error_of([&] {
              SequenceWriter(folder / "a.lts", info_of({40000, 1}), {.threads = 1});
            }).kind(),
            ErrorKind::Usage);
  EXPECT_EQ(error_of([&] {
              SequenceWriter(folder / "none" / "a.lts", info_of(kSmall), {.threads = 1});
            }).kind(),
            ErrorKind::Failed);
}

}  // namespace
}  // namespace lenticule::frames
