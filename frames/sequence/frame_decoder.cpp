// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/frame_decoder.h"

#include "frames/sequence/file_bytes.h"

namespace lenticule::frames {

FrameDecoder::FrameDecoder(int fd, const SequenceLayout& layout)
    : fd_(fd),
      layout_(layout),
      decoder_(layout.header.band_bytes(0)),
      entries_(static_cast<size_t>(layout.header.bands())),
      table_(layout.header.table_bytes()),
      payload_(layout.header.band_bytes(0)) {}

bool FrameDecoder::read_payload(const BandEntry& entry) noexcept {
  const std::span<uint8_t> payload = std::span(payload_).first(entry.bytes);
  return read_at(fd_, entry.offset, payload) && checksum_of(payload) == entry.checksum;
}

bool FrameDecoder::decode(uint64_t frame, std::span<uint8_t> to) noexcept {
  if (!read_band_table(fd_, layout_, frame, entries_, table_)) return false;
  for (int band = 0; band < layout_.header.bands(); ++band) {
    const BandEntry& entry = entries_[static_cast<size_t>(band)];
    const std::span<uint8_t> pixels =
        to.subspan(layout_.header.band_offset(band), layout_.header.band_bytes(band));
    if (!read_payload(entry) ||
        !decoder_.decode(entry.codec, std::span(payload_).first(entry.bytes), pixels))
      return false;
  }
  return true;
}

bool FrameDecoder::check(uint64_t frame) noexcept {
  if (!read_band_table(fd_, layout_, frame, entries_, table_)) return false;
  for (const BandEntry& entry : entries_) {
    if (!read_payload(entry)) return false;
  }
  return true;
}

}  // namespace lenticule::frames
