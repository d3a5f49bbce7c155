// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_format.h"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "frames/sequence/little_endian.h"

namespace lenticule::frames {
namespace {

// A non-text byte, the name, both kinds of line end, an end-of-file character: a program that
// treats the file as text damages the first bytes.
constexpr std::array<uint8_t, 8> kFileMagic = {0x89, 'L', 'T', 'S', '\r', '\n', 0x1a, '\n'};
constexpr std::array<uint8_t, 4> kFrameMagic = {'L', 'T', 'S', 'F'};
constexpr std::array<uint8_t, 8> kTrailerMagic = {'L', 'T', 'S', 'E', 'N', 'D', '\r', '\n'};
constexpr uint32_t kEndianTag = 0x01020304;
constexpr int kUsualBands = 36;
constexpr int kFewRows = 8;

void append_bytes(std::span<const uint8_t> bytes, std::vector<uint8_t>& to) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

bool begins_with(std::span<const uint8_t> bytes, std::span<const uint8_t> magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

/// Appends the checksum of the bytes since `begin`.
void append_checksum(size_t begin, std::vector<uint8_t>& to) {
  append_u64(to, checksum_of(std::span(to).subspan(begin)));
}

bool checksum_holds(std::span<const uint8_t> bytes, size_t at) {
  return load_u64(bytes.data() + at) == checksum_of(bytes.first(at));
}

bool in_range(const FileHeader& header) {
  if (!can_hold(header.geometry) || header.band_rows < 1) return false;
  if (header.band_rows > header.geometry.height) return false;
  return static_cast<uint32_t>(header.bands()) <= kMaxBands &&
         header.band_bytes(0) <= kMaxBandBytes;
}

}  // namespace

uint64_t checksum_of(std::span<const uint8_t> bytes) noexcept {
  return XXH3_64bits(bytes.data(), bytes.size());
}

int choose_band_rows(const FrameGeometry& geometry) {
  const int usual = (geometry.height + kUsualBands - 1) / kUsualBands;
  const auto most = static_cast<int>(kMaxBandBytes / std::max<size_t>(geometry.row_bytes(), 1));
  return std::clamp(usual, std::min(kFewRows, geometry.height),
                    std::max(1, std::min(most, geometry.height)));
}

bool can_hold(const FrameGeometry& geometry) {
  return geometry.width >= 1 && geometry.width <= kMaxSequencePixels && geometry.height >= 1 &&
         geometry.height <= kMaxSequencePixels && geometry.format == PixelFormat::Rgb8 &&
         geometry.frame_bytes() <= kMaxSequenceFrameBytes;
}

void append_file_header(const FileHeader& header, std::vector<uint8_t>& to) {
  const size_t begin = to.size();
  append_bytes(kFileMagic, to);
  append_u32(to, kSequenceVersion);
  append_u32(to, kEndianTag);
  append_u32(to, static_cast<uint32_t>(header.geometry.width));
  append_u32(to, static_cast<uint32_t>(header.geometry.height));
  append_u32(to, static_cast<uint32_t>(header.geometry.format));
  append_u32(to, static_cast<uint32_t>(header.band_rows));
  append_u64(to, header.metadata_bytes);
  append_u64(to, header.metadata_checksum);
  append_u64(to, 0);
  append_checksum(begin, to);
}

HeaderFlaw parse_file_header(std::span<const uint8_t> bytes, FileHeader& header) {
  if (bytes.size() < kFileHeaderBytes || !begins_with(bytes, kFileMagic))
    return HeaderFlaw::NoSequence;
  if (load_u32(&bytes[8]) != kSequenceVersion) return HeaderFlaw::OtherVersion;
  if (!checksum_holds(bytes, kFileHeaderBytes - 8) || load_u32(&bytes[12]) != kEndianTag)
    return HeaderFlaw::Damaged;
  const uint32_t width = load_u32(&bytes[16]);
  const uint32_t height = load_u32(&bytes[20]);
  const uint32_t rows = load_u32(&bytes[28]);
  constexpr auto kMost = static_cast<uint32_t>(kMaxSequencePixels);
  if (width > kMost || height > kMost || rows > kMost) return HeaderFlaw::OutOfRange;
  header.geometry = {static_cast<int>(width), static_cast<int>(height),
                     static_cast<PixelFormat>(load_u32(&bytes[24]))};
  header.band_rows = static_cast<int>(rows);
  header.metadata_bytes = load_u64(&bytes[32]);
  header.metadata_checksum = load_u64(&bytes[40]);
  return in_range(header) ? HeaderFlaw::None : HeaderFlaw::OutOfRange;
}

void append_frame_header(const FrameHeader& header, int bands, std::vector<uint8_t>& to) {
  const size_t begin = to.size();
  append_bytes(kFrameMagic, to);
  append_u32(to, static_cast<uint32_t>(bands));
  append_u64(to, header.number);
  append_u64(to, header.payload_bytes);
  append_u64(to, header.table_checksum);
  append_checksum(begin, to);
}

std::optional<FrameHeader> parse_frame_header(std::span<const uint8_t> bytes, int bands) noexcept {
  if (bytes.size() < kFrameHeaderBytes || !begins_with(bytes, kFrameMagic) ||
      !checksum_holds(bytes, kFrameHeaderBytes - 8) ||
      load_u32(&bytes[4]) != static_cast<uint32_t>(bands))
    return std::nullopt;
  return FrameHeader{.number = load_u64(&bytes[8]),
                     .payload_bytes = load_u64(&bytes[16]),
                     .table_checksum = load_u64(&bytes[24])};
}

void append_band_entry(const BandEntry& entry, std::vector<uint8_t>& to) {
  append_u64(to, entry.offset);
  append_u32(to, entry.bytes);
  append_u32(to, static_cast<uint32_t>(entry.codec));
  append_u64(to, entry.checksum);
}

std::optional<BandEntry> parse_band_entry(std::span<const uint8_t> bytes) noexcept {
  const uint32_t codec = load_u32(&bytes[12]);
  if (codec >= kBandCodecs) return std::nullopt;
  return BandEntry{.offset = load_u64(bytes.data()),
                   .bytes = load_u32(&bytes[8]),
                   .codec = static_cast<BandCodec>(codec),
                   .checksum = load_u64(&bytes[16])};
}

void append_trailer(const Trailer& trailer, std::vector<uint8_t>& to) {
  const size_t begin = to.size();
  append_u64(to, trailer.index_offset);
  append_u64(to, trailer.frame_count);
  append_u64(to, trailer.index_checksum);
  append_checksum(begin, to);
  append_bytes(kTrailerMagic, to);
}

std::optional<Trailer> parse_trailer(std::span<const uint8_t> bytes) noexcept {
  if (bytes.size() < kTrailerBytes || !begins_with(bytes.subspan(32), kTrailerMagic) ||
      !checksum_holds(bytes, 24))
    return std::nullopt;
  return Trailer{.index_offset = load_u64(bytes.data()),
                 .frame_count = load_u64(&bytes[8]),
                 .index_checksum = load_u64(&bytes[16])};
}

std::span<const uint8_t> frame_magic() noexcept {
  return kFrameMagic;
}

}  // namespace lenticule::frames
