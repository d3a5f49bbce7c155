// SPDX-License-Identifier: Apache-2.0
// Tests files of more than 4 GiB, made with holes: read at their end, and continued there.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "small_sequences.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::Content;
using test::info_of;
using test::make_frame;

constexpr FrameGeometry kGeometry{50, 30};
constexpr uint64_t kFar = (uint64_t{5} << 30) + 12345;

/// Returns the second frame's record with the offsets that it needs at position `to`.
std::vector<uint8_t> moved_record(int fd, const SequenceLayout& layout, uint64_t to) {
  const uint64_t from = layout.frames[1];
  std::vector<BandEntry> entries(static_cast<size_t>(layout.header.bands()));
  std::vector<uint8_t> scratch(layout.header.table_bytes());
  EXPECT_TRUE(read_band_table(fd, layout, 1, entries, scratch));
  const size_t head = kFrameHeaderBytes + layout.header.table_bytes();
  std::vector<uint8_t> payload(layout.data_end - from - head);
  EXPECT_TRUE(read_at(fd, from + head, payload));
  std::vector<uint8_t> table;
  for (BandEntry& entry : entries) {
    entry.offset += to - from;
    append_band_entry(entry, table);
  }
  std::vector<uint8_t> record;
  append_frame_header(
      {.number = 1, .payload_bytes = payload.size(), .table_checksum = checksum_of(table)},
      layout.header.bands(), record);
  record.insert(record.end(), table.begin(), table.end());
  record.insert(record.end(), payload.begin(), payload.end());
  return record;
}

/// Moves the second of two frames beyond 4 GiB; a hole lies between them.
void stretch(const std::filesystem::path& file) {
  const UniqueFd fd(::open(file.c_str(), O_RDWR | O_CLOEXEC));
  const SequenceLayout layout = read_sequence_layout(fd.get(), file.string());
  const std::vector<uint8_t> record = moved_record(fd.get(), layout, kFar);
  ASSERT_TRUE(write_at(fd.get(), kFar, record));
  std::vector<uint8_t> index;
  append_u64(index, layout.frames[0]);
  append_u64(index, kFar);
  append_trailer({.index_offset = kFar + record.size(),
                  .frame_count = 2,
                  .index_checksum = checksum_of(index)},
                 index);
  ASSERT_TRUE(write_at(fd.get(), kFar + record.size(), index));
}

TEST(SequenceLarge, IsReadAndContinuedBeyondFourGibibytes) {
  const test::ScratchFolder folder;
  const std::filesystem::path file = folder / "a.lts";
  test::write_sequence(file, kGeometry, Content::Noise, 2);
  stretch(file);
  {
    SequenceWriter writer(file, info_of(kGeometry), {.resume = true, .threads = 1});
    ASSERT_EQ(writer.frame_count(), 2u);
    writer.append(make_frame(kGeometry, Content::Noise, 2).view());
    writer.finish();
  }
  const SequenceReader reader(file);
  EXPECT_GT(reader.file_bytes(), kFar);
  ASSERT_EQ(reader.frame_count(), 3u);
  FrameDecoder decoder = reader.make_decoder();
  WovenFrame frame(kGeometry);
  for (const int n : {2, 1, 0}) {
    ASSERT_TRUE(decoder.decode(static_cast<uint64_t>(n), frame.bytes()));
    EXPECT_EQ(frame, make_frame(kGeometry, Content::Noise, n));
  }
}

}  // namespace
}  // namespace lenticule::frames
