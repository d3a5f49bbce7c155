// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "frames/sequence/file_bytes.h"
#include "frames/sequence/little_endian.h"

namespace lenticule::frames {
namespace {

constexpr size_t kOffsetBytes = 8;
constexpr size_t kSearchChunk = size_t{1} << 20;
/// Limits that stop the search in a file of many damaged frames.
constexpr int kMaxSearches = 64;
constexpr int kMaxFalseStarts = 4096;

[[noreturn]] void refuse(const std::string& source, const char* cause, const char* remedy) {
  throw Error(ErrorKind::Input, fmt::format("{}: {}", source, cause), remedy);
}

FileHeader read_file_header(int fd, const std::string& source) {
  std::array<uint8_t, kFileHeaderBytes> bytes{};
  FileHeader header;
  const bool whole = read_at(fd, 0, bytes);
  const HeaderFlaw flaw = whole ? parse_file_header(bytes, header) : HeaderFlaw::NoSequence;
  switch (flaw) {
    case HeaderFlaw::None:
      return header;
    case HeaderFlaw::NoSequence:
      refuse(source, "not a sequence container", "use a file that lenticule wrote (.lts)");
    case HeaderFlaw::OtherVersion:
      refuse(source, "unsupported version of the sequence container",
             "use the version of lenticule that wrote it, or convert the file with that version");
    case HeaderFlaw::Damaged:
      refuse(source, "the header is damaged", "restore the file from a copy, or render it again");
    case HeaderFlaw::OutOfRange:
      break;
  }
  refuse(source, "frame size not supported", "the limits are in docs/content/formats.md");
}

SequenceInfo read_info(int fd, const FileHeader& header, uint64_t file_bytes,
                       const std::string& source) {
  if (header.metadata_bytes > kMaxMetadataBytes || header.data_begin() > file_bytes)
    refuse(source, "the file ends within its metadata",
           "restore the file from a copy, or render it again");
  std::vector<uint8_t> text(header.metadata_bytes);
  if (!read_at(fd, kFileHeaderBytes, text) || checksum_of(text) != header.metadata_checksum)
    refuse(source, "the metadata is damaged", "restore the file from a copy, or render it again");
  return parse_sequence_info({reinterpret_cast<const char*>(text.data()), text.size()},
                             header.geometry, source);
}

uint64_t least_frame_bytes(const FileHeader& header) {
  return kFrameHeaderBytes + header.table_bytes();
}

uint64_t most_frame_bytes(const FileHeader& header) {
  return least_frame_bytes(header) + header.geometry.frame_bytes();
}

/// Returns true if every offset is behind the one before, with space for a frame's header between
/// them.
bool offsets_make_sense(const std::vector<uint64_t>& frames, const FileHeader& header,
                        uint64_t end) {
  uint64_t earliest = header.data_begin();
  for (const uint64_t offset : frames) {
    if (offset < earliest || offset > end || end - offset < least_frame_bytes(header)) return false;
    earliest = offset + least_frame_bytes(header);
  }
  return true;
}

/// Returns true if the file has a whole index.
bool read_index(int fd, uint64_t file_bytes, SequenceLayout& layout) {
  if (file_bytes < layout.header.data_begin() + kTrailerBytes) return false;
  std::array<uint8_t, kTrailerBytes> bytes{};
  if (!read_at(fd, file_bytes - kTrailerBytes, bytes)) return false;
  const std::optional<Trailer> trailer = parse_trailer(bytes);
  if (!trailer || trailer->frame_count > kMaxSequenceFrames) return false;
  const uint64_t index_bytes = trailer->frame_count * kOffsetBytes;
  const uint64_t available = file_bytes - kTrailerBytes - layout.header.data_begin();
  if (index_bytes > available || trailer->index_offset != file_bytes - kTrailerBytes - index_bytes)
    return false;
  std::vector<uint8_t> index(index_bytes);
  if (!read_at(fd, trailer->index_offset, index) || checksum_of(index) != trailer->index_checksum)
    return false;
  layout.frames.resize(trailer->frame_count);
  for (size_t i = 0; i < layout.frames.size(); ++i)
    layout.frames[i] = load_u64(&index[i * kOffsetBytes]);
  layout.data_end = trailer->index_offset;
  return offsets_make_sense(layout.frames, layout.header, layout.data_end);
}

/// Returns true if the last frame is followed by an index that may be damaged or incomplete.
bool index_follows(int fd, uint64_t file_bytes, const SequenceLayout& layout) {
  const uint64_t index_bytes = layout.frames.size() * kOffsetBytes;
  const uint64_t rest = file_bytes - layout.data_end;
  if (rest == index_bytes + kTrailerBytes) return true;
  std::vector<uint8_t> index(std::min(rest, index_bytes));
  if (index.size() < kOffsetBytes || !read_at(fd, layout.data_end, index)) return false;
  for (size_t at = 0; at + kOffsetBytes <= index.size(); at += kOffsetBytes)
    if (load_u64(&index[at]) != layout.frames[at / kOffsetBytes]) return false;
  return true;
}

/// FrameSearch finds the frames of a file without their index.
class FrameSearch {
 public:
  FrameSearch(int fd, const FileHeader& header, uint64_t file_bytes)
      : fd_(fd), header_(header), file_bytes_(file_bytes) {}

  void run(SequenceLayout& layout) {
    uint64_t position = header_.data_begin();
    layout.data_end = position;
    while (layout.frames.size() < kMaxSequenceFrames) {
      std::optional<FrameHeader> frame = frame_at(position);
      if (!frame || frame->number != layout.frames.size())
        frame = next_frame(position, layout.frames.size());
      if (!frame) return;
      layout.frames.resize(frame->number, 0);  // the frames before this one are lost
      layout.frames.push_back(position);
      position += least_frame_bytes(header_) + frame->payload_bytes;
      layout.data_end = position;
    }
  }

 private:
  /// Returns the header of a frame that lies whole within the file.
  std::optional<FrameHeader> frame_at(uint64_t position) {
    std::array<uint8_t, kFrameHeaderBytes> bytes{};
    if (position > file_bytes_ || file_bytes_ - position < least_frame_bytes(header_))
      return std::nullopt;
    if (!read_at(fd_, position, bytes)) return std::nullopt;
    const std::optional<FrameHeader> frame = parse_frame_header(bytes, header_.bands());
    const uint64_t room = file_bytes_ - position - least_frame_bytes(header_);
    if (!frame || frame->payload_bytes > std::min<uint64_t>(room, header_.geometry.frame_bytes()))
      return std::nullopt;
    return frame;
  }

  /// Finds the next frame after a damaged one. A damaged frame is at most as long as the largest
  /// frame, which limits the distance to the next one.
  std::optional<FrameHeader> next_frame(uint64_t& position, uint64_t number) {
    if (++searches_ > kMaxSearches) return std::nullopt;
    const uint64_t end =
        std::min(file_bytes_, position + most_frame_bytes(header_) + frame_magic().size());
    for (uint64_t from = position + 1; from < end;) {
      const std::optional<uint64_t> found = find_magic(from, end);
      if (!found || ++false_starts_ > kMaxFalseStarts) return std::nullopt;
      const std::optional<FrameHeader> frame = frame_at(*found);
      if (frame && frame->number > number && frame->number - number <= kMaxSearches) {
        position = *found;
        return frame;
      }
      from = *found + 1;
    }
    return std::nullopt;
  }

  std::optional<uint64_t> find_magic(uint64_t from, uint64_t end) {
    const std::span<const uint8_t> magic = frame_magic();
    for (; from + magic.size() <= end; from += kSearchChunk) {
      chunk_.resize(std::min<uint64_t>(kSearchChunk + magic.size() - 1, end - from));
      if (!read_at(fd_, from, chunk_)) return std::nullopt;
      const auto at = std::search(chunk_.begin(), chunk_.end(), magic.begin(), magic.end());
      if (at != chunk_.end()) return from + static_cast<uint64_t>(at - chunk_.begin());
    }
    return std::nullopt;
  }

  int fd_;
  const FileHeader& header_;
  uint64_t file_bytes_;
  std::vector<uint8_t> chunk_;
  int searches_ = 0;
  int false_starts_ = 0;
};

/// Returns true if the band belongs to this frame or to an earlier one, and is no larger than its
/// pixels.
bool is_valid(const BandEntry& entry, const FileHeader& header, int band, uint64_t frame_end) {
  return entry.bytes >= 1 && entry.bytes <= header.band_bytes(band) &&
         entry.offset >= header.data_begin() && entry.offset <= frame_end &&
         frame_end - entry.offset >= entry.bytes;
}

}  // namespace

void append_file_start(const SequenceInfo& info, FileHeader& header, std::vector<uint8_t>& to) {
  const std::string metadata = sequence_info_to_json(info);
  header.geometry = info.geometry;
  header.band_rows = choose_band_rows(info.geometry);
  header.metadata_bytes = metadata.size();
  header.metadata_checksum =
      checksum_of({reinterpret_cast<const uint8_t*>(metadata.data()), metadata.size()});
  append_file_header(header, to);
  to.insert(to.end(), metadata.begin(), metadata.end());
}

void append_index(const std::vector<uint64_t>& frames, uint64_t data_end,
                  std::vector<uint8_t>& to) {
  std::vector<uint8_t> index;
  index.reserve(frames.size() * kOffsetBytes + kTrailerBytes);
  for (const uint64_t offset : frames) append_u64(index, offset);
  const Trailer trailer{
      .index_offset = data_end, .frame_count = frames.size(), .index_checksum = checksum_of(index)};
  append_trailer(trailer, index);
  to.insert(to.end(), index.begin(), index.end());
}

SequenceLayout read_sequence_layout(int fd, const std::string& source) {
  const uint64_t file_bytes = size_of(fd);
  SequenceLayout layout;
  layout.header = read_file_header(fd, source);
  layout.info = read_info(fd, layout.header, file_bytes, source);
  layout.from_index = layout.has_every_frame = read_index(fd, file_bytes, layout);
  if (layout.from_index) return layout;
  layout.frames.clear();
  FrameSearch(fd, layout.header, file_bytes).run(layout);
  layout.has_every_frame = index_follows(fd, file_bytes, layout);
  return layout;
}

bool read_band_table(int fd, const SequenceLayout& layout, uint64_t frame,
                     std::span<BandEntry> entries, std::span<uint8_t> scratch) noexcept {
  const FileHeader& header = layout.header;
  const uint64_t offset = layout.frames[frame];
  std::array<uint8_t, kFrameHeaderBytes> head{};
  if (offset == 0 || !read_at(fd, offset, head)) return false;
  const std::optional<FrameHeader> parsed = parse_frame_header(head, header.bands());
  if (!parsed || parsed->number != frame || parsed->payload_bytes > header.geometry.frame_bytes())
    return false;
  const std::span<uint8_t> table = scratch.first(header.table_bytes());
  if (!read_at(fd, offset + kFrameHeaderBytes, table)) return false;
  if (checksum_of(table) != parsed->table_checksum) return false;
  const uint64_t frame_end = offset + least_frame_bytes(header) + parsed->payload_bytes;
  for (int band = 0; band < header.bands(); ++band) {
    const auto at = static_cast<size_t>(band) * kBandEntryBytes;
    const std::optional<BandEntry> entry = parse_band_entry(table.subspan(at, kBandEntryBytes));
    if (!entry || !is_valid(*entry, header, band, frame_end)) return false;
    entries[static_cast<size_t>(band)] = *entry;
  }
  return true;
}

}  // namespace lenticule::frames
