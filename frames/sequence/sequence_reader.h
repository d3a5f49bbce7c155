// SPDX-License-Identifier: Apache-2.0
// SequenceReader reads any frame of a sequence container, in any order.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "base/unique_fd.h"
#include "frames/decoded_source.h"
#include "frames/frame.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::frames {

/// FrameDecoder decodes frames of an open container, in one thread.
///
/// FrameDecoder allocates all memory in its constructor.
///
/// Lifetime: `layout` must outlive the decoder.
class FrameDecoder {
 public:
  FrameDecoder(int fd, const SequenceLayout& layout);

  /// Decodes a frame into `to` (frame_bytes() long). Returns false if any byte of the frame is
  /// damaged or cannot be read; `to` is undefined then. Neither throws nor allocates.
  [[nodiscard]] bool decode(uint64_t frame, std::span<uint8_t> to) noexcept;
  /// Checks only the checksums. Returns the same result as decode().
  [[nodiscard]] bool check(uint64_t frame) noexcept;

 private:
  [[nodiscard]] bool read_payload(const BandEntry& entry) noexcept;

  int fd_;
  const SequenceLayout& layout_;
  BandDecoder decoder_;
  std::vector<BandEntry> entries_;
  std::vector<uint8_t> table_;
  std::vector<uint8_t> payload_;
};

/// Returns true for ".lts", and for ".lts.part", the name of an unfinished file.
[[nodiscard]] bool is_sequence_name(const std::filesystem::path& file);
[[nodiscard]] bool is_unfinished_name(const std::filesystem::path& file);

class SequenceReader {
 public:
  /// Throws Error(Input) for a file that cannot be opened or is not a sequence (see
  /// read_sequence_layout).
  explicit SequenceReader(const std::filesystem::path& file);
  SequenceReader(const SequenceReader&) = delete;
  SequenceReader& operator=(const SequenceReader&) = delete;

  [[nodiscard]] const SequenceInfo& info() const { return layout_.info; }
  [[nodiscard]] FrameGeometry geometry() const { return layout_.header.geometry; }
  [[nodiscard]] uint64_t frame_count() const { return layout_.frames.size(); }
  /// Returns false if the index is missing or damaged, and the frames were found without it.
  [[nodiscard]] bool has_index() const { return layout_.from_index; }
  [[nodiscard]] uint64_t file_bytes() const;
  /// Returns the smallest number of frames that can be missing at the end: 0, or, if the finished
  /// file was cut, 1 or the number of frames up to the end of its loop.
  [[nodiscard]] uint64_t missing_frames() const { return missing_; }

  /// Returns a decoder for one thread.
  ///
  /// Lifetime: the reader must outlive the decoder.
  [[nodiscard]] FrameDecoder make_decoder() const { return {fd_.get(), layout_}; }

  /// Advise the kernel to fetch a frame, and that a frame's pages are no longer needed.
  void will_need(uint64_t frame) const noexcept;
  void done_with(uint64_t frame) const noexcept;

  /// Returns the numbers of the frames that do not decode. Calls `progress` for every frame; stops
  /// when `progress` returns false.
  [[nodiscard]] std::vector<uint64_t> find_damaged(
      const std::function<bool(uint64_t frame)>& progress = {}) const;

 private:
  void advise(uint64_t frame, int advice) const noexcept;

  UniqueFd fd_;
  SequenceLayout layout_;
  uint64_t missing_;
};

// SequenceSource plays pre-rendered frames from a sequence container. Its own threads decode ahead
// into a bounded pool. Damaged frames are replaced and counted, and playback continues.

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
