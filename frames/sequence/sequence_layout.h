// SPDX-License-Identifier: Apache-2.0
// SequenceLayout holds the offsets of all parts of a sequence container: from its index, or from
// the frames themselves if the index is missing (writing was interrupted) or damaged.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_info.h"

namespace lenticule::frames {

struct SequenceLayout {
  FileHeader header;
  SequenceInfo info;
  std::vector<uint64_t> frames;  ///< offsets of the frame headers; 0 for a damaged frame
  uint64_t data_end = 0;         ///< end of the last frame, where the next frame would be appended
  bool from_index = false;       ///< false: the frames were found by scanning the file
  bool has_every_frame = false;  ///< false: the file ends after some frame, without its index
};

/// Append what precedes the frames of a new file, whose header this sets, and what follows them.
void append_file_start(const SequenceInfo& info, FileHeader& header, std::vector<uint8_t>& to);
void append_index(const std::vector<uint64_t>& frames, uint64_t data_end, std::vector<uint8_t>& to);

/// Reads the header, the metadata and the index of an open file. Throws Error(Input) that begins
/// with `source` for a file that is not a sequence, has another version, or has a damaged header or
/// damaged metadata. Other damage loses frames, not the file. Memory is bounded by the file's size.
[[nodiscard]] SequenceLayout read_sequence_layout(int fd, const std::string& source);

/// Reads the band table of one frame. Returns false if the table is damaged or points beyond the
/// frame's end. `entries` has header.bands() elements; `scratch` is at least table_bytes() long.
[[nodiscard]] bool read_band_table(int fd, const SequenceLayout& layout, uint64_t frame,
                                   std::span<BandEntry> entries,
                                   std::span<uint8_t> scratch) noexcept;

}  // namespace lenticule::frames
