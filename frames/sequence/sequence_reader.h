// SPDX-License-Identifier: Apache-2.0
// SequenceReader reads any frame of a sequence container, in any order.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame.h"
#include "frames/sequence/frame_decoder.h"
#include "frames/sequence/sequence_layout.h"

namespace lenticule::frames {

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

}  // namespace lenticule::frames
