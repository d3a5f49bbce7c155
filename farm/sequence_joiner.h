// SPDX-License-Identifier: Apache-2.0
// SequenceJoiner joins containers that are consecutive parts of one film (SequencePart) without
// decoding a frame. The film has the bytes that one SequenceWriter would have written.
//
// Only two things depend on the frames before a part: offsets, which are written anew, and bands of
// the part's first frame that have the pixels of the frame before. The film has these bands only
// once. They are found by the digests of their pixels, which the maker of each part states.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/temporary.h"
#include "frames/frame.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::farm {

/// Returns the XXH3 of the pixels of each band that a container would have for the frame.
[[nodiscard]] std::vector<uint64_t> band_digests(const frames::FrameView& frame);

/// Returns the 128-bit XXH3 of a file in 32 hexadecimal digits. Throws Error(Input).
[[nodiscard]] std::string digest_of_file(const std::filesystem::path& file);
[[nodiscard]] std::string digest_of_text(std::string_view text);

struct FilmPart {
  std::filesystem::path file;
  std::string digest;                   ///< digest_of_file()
  std::vector<uint64_t> first_bands{};  ///< band_digests() of the part's first and last frames
  std::vector<uint64_t> last_bands{};
};

/// SequenceJoiner writes to a temporary file beside the film, which finish() renames. Memory: some
/// MiB and eight bytes for each frame, for a film of any length.
///
/// Thread safety: one thread.
class SequenceJoiner {
 public:
  /// Throws Error(Failed) if the film cannot be written.
  SequenceJoiner(std::filesystem::path film, const frames::SequenceInfo& info);
  ~SequenceJoiner();

  [[nodiscard]] uint64_t frame_count() const { return frames_.size(); }
  /// Returns the size of the film, after finish() with its index.
  [[nodiscard]] uint64_t bytes_written() const { return end_; }

  /// Appends the frames of a finished container that continues the film. Throws Error(Input) that
  /// begins with the part's file if the part is damaged, was made with another rig, size or rate,
  /// or has other frames than the next ones; Error(Failed) if the film cannot be written. The film
  /// cannot be continued after an error.
  void append(const FilmPart& part);

  /// Writes the index and replaces the film. Throws Error(Failed).
  void finish();

 private:
  class PartStream;
  class PartReader;

  void append_frame(PartReader& part, uint64_t frame, const FilmPart& about);
  [[nodiscard]] bool repeats(const FilmPart& about, size_t band) const;
  void add(std::span<const uint8_t> bytes);
  void write_out();
  void write(std::span<const uint8_t> bytes);

  std::filesystem::path film_;
  frames::SequenceInfo info_;
  frames::FileHeader header_;
  TemporaryFile file_;
  std::vector<uint64_t> frames_;
  std::vector<frames::BandEntry> bands_;       ///< bands of the film's last frame
  std::vector<uint64_t> last_digests_{};       ///< digests of the last part's last bands
  std::vector<uint8_t> out_;                   ///< bytes before end_ that are not yet written
  std::vector<std::vector<uint8_t>> buffers_;  ///< pieces of the part that is read ahead
  uint64_t written_ = 0;
  uint64_t flushed_ = 0;  ///< bytes that the disk was told to write
  uint64_t end_ = 0;
};

}  // namespace lenticule::farm
