// SPDX-License-Identifier: Apache-2.0
// Woven frames into a lossless video file, through lenticule-video.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "frames/frame.h"
#include "frames/rational.h"

namespace lenticule::player {

enum class VideoCodec {
  Ffv1,     ///< every frame of its own, checksums; the default
  X264Rgb,  ///< H.264 High 4:4:4 with qp 0: smaller for steady pictures, slower to jump in
};

struct VideoWriterOptions {
  std::filesystem::path file;  ///< Matroska, whatever it is called
  frames::FrameGeometry geometry;
  frames::Rate rate;
  VideoCodec codec = VideoCodec::Ffv1;
  std::filesystem::path program = {};  ///< lenticule-video; empty = where it is installed
};

/// Writes to a temporary name beside the file; finish() renames it. Without finish() nothing is
/// left. One thread, which waits for the encoder, at most a minute for a frame: Error(Failed) then.
class VideoWriter {
 public:
  /// Throws Error(Failed) when the file or the encoder cannot be had.
  explicit VideoWriter(const VideoWriterOptions& options);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  /// The next frame; it has the options' geometry. Throws Error(Failed) in the encoder's words.
  void write(const frames::FrameView& frame);
  /// The whole file is under its name after this. Throws as write().
  void finish();

 private:
  class Encoder;
  std::unique_ptr<Encoder> encoder_;
};

}  // namespace lenticule::player
