// SPDX-License-Identifier: Apache-2.0
// Where everything lies in a sequence container: from its index, or from the frames themselves
// where the index is missing (writing was interrupted) or damaged.
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
  std::vector<uint64_t> frames;  ///< offsets of the frame headers; 0 for one that is damaged
  uint64_t data_end = 0;         ///< behind the last frame: where the next one would go
  bool from_index = false;       ///< false: the frames were looked for one after the other
};

/// Reads the header, the metadata and the index of an open file. Throws Error(Input) that begins
/// with `source` for a file that is no sequence, of another version, or whose header or metadata
/// are damaged. Damage behind that costs frames, not the file. Memory is bounded by the file's
/// size.
[[nodiscard]] SequenceLayout read_sequence_layout(int fd, const std::string& source);

/// The bands of one frame. False if the table is damaged or points outside of what lies before the
/// frame's end. `entries` has header.bands() places; `scratch` is at least table_bytes() long.
[[nodiscard]] bool read_band_table(int fd, const SequenceLayout& layout, uint64_t frame,
                                   std::span<BandEntry> entries,
                                   std::span<uint8_t> scratch) noexcept;

}  // namespace lenticule::frames
