// SPDX-License-Identifier: Apache-2.0
// SequenceSource plays pre-rendered frames from a sequence container. Its own threads decode ahead
// into a bounded pool. Damaged frames are replaced and counted, and playback continues.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "frames/decoded_source.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::frames {

struct SequenceSourceOptions {
  int pool_frames = 8;      ///< limit of decoded frames in memory, at least 2; allocated at once
  int decoder_threads = 1;  ///< 1..64, each decodes its own frame
  /// Frames [begin, end) of the file, 0-based, instead of all frames; must not be empty.
  uint64_t begin = 0;
  std::optional<uint64_t> end = std::nullopt;
  /// Number of frames omitted at the start of the first round; the number of all frames counts as
  /// none.
  uint64_t first = 0;
  /// A larger file is read without keeping it in the page cache; a smaller file stays in the cache.
  uint64_t cached_file_bytes = uint64_t{1} << 30;
};

/// SequenceSource plays the first round from the first frame to the end of the loop, and every
/// later round from the beginning of the loop to its end, without a gap. A loop that fits the pool
/// is decoded once.
///
/// A frame with a damaged band is replaced by the nearest undamaged frame before it (or after it,
/// at the start). The source fails only if none of the 64 frames on either side can be read.
class SequenceSource final : public DecodedSource {
 public:
  /// Throws the Error(Input) of SequenceReader, also for a file without a frame, and for a range
  /// that the file does not contain.
  explicit SequenceSource(const std::filesystem::path& file,
                          const SequenceSourceOptions& options = {});

  [[nodiscard]] const SequenceInfo& info() const;
  /// Returns the number of damaged frames that were decoded; each of them was replaced.
  [[nodiscard]] uint64_t damaged_frames() const;
  /// Missing are the frames behind the end of a file that was cut: at least one.
  [[nodiscard]] FrameDamage damage() const override;

 private:
  class Frames;

  const Frames& frames_;  ///< owned by DecodedSource
};

}  // namespace lenticule::frames
