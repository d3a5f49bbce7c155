// SPDX-License-Identifier: Apache-2.0
// ImageSequence plays pre-rendered frames from picture files: a numbered sequence, a list, or one
// still. Its own threads decode ahead into a bounded pool.
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

/// Returns the files of a player's SOURCE argument: every file of a pattern ("dir/%05d.png") from
/// the first number on, or the one file. Throws Error(Input) when there is no file or a number in
/// between is missing (named), Error(Usage) for an invalid pattern.
[[nodiscard]] std::vector<std::filesystem::path> list_frame_files(const std::string& source);

struct ImageSequenceOptions {
  /// Limit of decoded frames in memory; at least 2. A sequence that fits is decoded once.
  int pool_frames = 8;
  /// Number of threads that decode ahead, 1..64. Decoding a 4K PNG takes about 0.13 s of one core.
  int decoder_threads = 1;
  std::optional<Rate> rate = std::nullopt;
  /// Index of the file with which the first round begins, less than the number of files; later
  /// rounds begin with the first file.
  uint64_t first = 0;
  PictureUse use = PictureUse::Woven;
  /// Memory limit; fewer than pool_frames frames are kept if they would exceed it, but at least 2.
  uint64_t pool_bytes = std::numeric_limits<uint64_t>::max();
  /// Called with the properties in the first file's header, before memory is allocated; throws to
  /// refuse the file.
  std::function<void(const PictureInfo&)> accept = nullptr;
};

/// ImageSequence requires that all files have the first file's size. The constructor opens the
/// first file and throws Error(Input) if it is not a picture; a later file that cannot be read ends
/// the sequence when its frame is pulled.
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
