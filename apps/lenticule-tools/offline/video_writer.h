// SPDX-License-Identifier: Apache-2.0
// VideoWriter writes woven frames to a lossless video file through lenticule-video.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "frames/frame.h"
#include "frames/rational.h"

namespace lenticule::tools {

enum class VideoCodec {
  Ffv1,     ///< intra-only frames with checksums; the default
  X264Rgb,  ///< H.264 High 4:4:4 with qp 0: smaller for static pictures, slower to seek
};

struct VideoWriterOptions {
  std::filesystem::path file;  ///< Matroska, with any name
  frames::FrameGeometry geometry;
  frames::Rate rate;
  VideoCodec codec = VideoCodec::Ffv1;
  std::filesystem::path program = {};  ///< lenticule-video; empty = search for it
};

/// Writes to a temporary name beside the file; finish() renames it, and without finish() it is
/// removed. Waits at most a minute per frame for the encoder, then throws Error(Failed). Thread
/// safety: one thread.
class VideoWriter {
 public:
  /// Throws Error(Failed) if the file or the encoder cannot be opened.
  explicit VideoWriter(const VideoWriterOptions& options);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  /// Writes the next frame, which must have the options' geometry. Throws Error(Failed) with the
  /// encoder's message.
  void write(const frames::FrameView& frame);
  /// Completes the file and gives it its name. Throws as write().
  void finish();

 private:
  class Encoder;
  std::unique_ptr<Encoder> encoder_;
};

}  // namespace lenticule::tools
