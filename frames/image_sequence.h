// SPDX-License-Identifier: Apache-2.0
// Pre-rendered frames from picture files: a numbered sequence, a list, or one still. Decoded ahead
// of time by threads of its own into a bounded pool.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frames/decoded_source.h"
#include "frames/image_io.h"

namespace lenticule::frames {

/// The files that a player's SOURCE argument means: every file of a pattern ("dir/%05d.png") from
/// the first number on, or the one file. Throws Error(Input) when there is none, or a number is
/// missing in between (named), Error(Usage) for a pattern that is none.
[[nodiscard]] std::vector<std::filesystem::path> list_frame_files(const std::string& source);

struct ImageSequenceOptions {
  /// Decoded frames kept in memory at most; at least 2. A sequence that fits is decoded once.
  int pool_frames = 8;
  /// Threads that decode ahead, 1..64. A 4K PNG takes one core about 0.13 s.
  int decoder_threads = 1;
  std::optional<Rate> rate = std::nullopt;
  /// Number of the file with which the first round begins, later ones beginning with the first;
  /// less than there are.
  uint64_t first = 0;
  PictureUse use = PictureUse::Woven;
  /// Fewer than pool_frames are kept where they would take more; at least 2.
  uint64_t pool_bytes = std::numeric_limits<uint64_t>::max();
  /// Called with what the first file's header says, before anything is allocated; throws to refuse.
  std::function<void(const PictureInfo&)> accept = nullptr;
};

/// All files must have the first one's size. The first file is opened by the constructor, which
/// throws Error(Input) if it is no picture; a later file that cannot be read ends the sequence when
/// its turn comes.
class ImageSequence final : public DecodedSource {
 public:
  explicit ImageSequence(std::vector<std::filesystem::path> files,
                         const ImageSequenceOptions& options = {});
  [[nodiscard]] double pixel_aspect() const override { return pixel_aspect_; }

 private:
  class Files;
  explicit ImageSequence(std::unique_ptr<Files> files);

  double pixel_aspect_;
};

}  // namespace lenticule::frames
