// SPDX-License-Identifier: Apache-2.0
// Tests sequence containers and their parts. The first byte chooses: an unchanged file, a file
// whose checksums are corrected first (to reach the parsers behind them), a band's payload, or
// metadata.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <vector>

#include "base/error.h"
#include "base/unique_fd.h"
#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::frames {
namespace {

constexpr uint64_t kMostFrameBytes = uint64_t{1} << 20;
constexpr size_t kMostFrames = 16;

void store_u64(uint64_t value, uint8_t* to) {
  for (int i = 0; i < 8; ++i) to[i] = static_cast<uint8_t>(value >> 8 * i);
}

/// Corrects the checksums of one frame's bands, table and header; returns the offset of the next
/// frame.
size_t repair_frame(std::vector<uint8_t>& file, size_t at, size_t bands) {
  const size_t table = at + kFrameHeaderBytes;
  const size_t payload = table + bands * kBandEntryBytes;
  if (payload > file.size()) return file.size();
  for (size_t band = 0; band < bands; ++band) {
    uint8_t* entry = &file[table + band * kBandEntryBytes];
    const uint64_t offset = load_u64(entry);
    const uint64_t bytes = load_u32(entry + 8);
    if (offset <= file.size() && bytes <= file.size() - offset)
      store_u64(checksum_of(std::span(file).subspan(offset, bytes)), entry + 16);
  }
  store_u64(checksum_of(std::span(file).subspan(table, payload - table)), &file[at + 24]);
  store_u64(checksum_of(std::span(file).subspan(at, 32)), &file[at + 32]);
  return payload + std::min<uint64_t>(load_u64(&file[at + 16]), file.size() - payload);
}

void repair(std::vector<uint8_t>& file) {
  if (file.size() < kFileHeaderBytes) return;
  const uint64_t metadata = load_u64(&file[32]);
  if (metadata > file.size() - kFileHeaderBytes) return;
  store_u64(checksum_of(std::span(file).subspan(kFileHeaderBytes, metadata)), &file[40]);
  store_u64(checksum_of(std::span(file).first(kFileHeaderBytes - 8)), &file[56]);
  FileHeader header;
  if (parse_file_header(file, header).cause != nullptr) return;
  for (size_t at = header.data_begin(); at + kFrameHeaderBytes <= file.size();)
    at = repair_frame(file, at, static_cast<size_t>(header.bands()));
}

void decode_some(int fd, const SequenceLayout& layout) {
  if (layout.header.geometry.frame_bytes() > kMostFrameBytes) return;
  FrameDecoder decoder(fd, layout);
  std::vector<uint8_t> pixels(layout.header.geometry.frame_bytes());
  for (size_t frame = 0; frame < std::min(layout.frames.size(), kMostFrames); ++frame)
    static_cast<void>(decoder.decode(frame, pixels));
}

void read_file(std::span<const uint8_t> bytes) {
  const UniqueFd fd(::memfd_create("lts", MFD_CLOEXEC));
  LENTICULE_CHECK(static_cast<bool>(fd) && write_at(fd.get(), 0, bytes));
  try {
    const SequenceLayout layout = read_sequence_layout(fd.get(), "fuzz");
    LENTICULE_CHECK(layout.data_end <= bytes.size());
    for (const uint64_t frame : layout.frames)
      LENTICULE_CHECK(frame == 0 || frame + kFrameHeaderBytes <= bytes.size());
    decode_some(fd.get(), layout);
  } catch (const Error& error) {
    LENTICULE_CHECK(error.kind() == ErrorKind::Input);
  }
}

void read_payload(std::span<const uint8_t> bytes) {
  if (bytes.size() < 4) return;
  std::vector<uint8_t> band(load_u32(bytes.data()) % 5000);
  BandDecoder decoder(band.size());
  for (uint8_t codec = 0; codec < kBandCodecs; ++codec)
    static_cast<void>(decoder.decode(static_cast<BandCodec>(codec), bytes.subspan(4), band));
}

void read_metadata(std::span<const uint8_t> bytes) {
  try {
    const FrameGeometry geometry{.width = 64, .height = 48};
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const SequenceInfo info = parse_sequence_info(text, geometry, "fuzz");
    LENTICULE_CHECK(parse_sequence_info(sequence_info_to_json(info), geometry, "again") == info);
  } catch (const Error& error) {
    LENTICULE_CHECK(error.kind() == ErrorKind::Input);
  }
}

}  // namespace
}  // namespace lenticule::frames

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::frames;
  if (size == 0) return 0;
  const std::span<const uint8_t> bytes(data + 1, size - 1);
  if (data[0] % 4 == 0) read_file(bytes);
  if (data[0] % 4 == 1) {
    std::vector<uint8_t> file(bytes.begin(), bytes.end());
    repair(file);
    read_file(file);
  }
  if (data[0] % 4 == 2) read_payload(bytes);
  if (data[0] % 4 == 3) read_metadata(bytes);
  return 0;
}
