// SPDX-License-Identifier: Apache-2.0
// Defines owners of FFmpeg's types, and FFmpeg's reading and writing of descriptors.
#pragma once

#include <memory>
#include <string>

#include "apps/lenticule-video/ffmpeg.h"

namespace lenticule::video {

/// Calls a function that frees an object and clears the pointer to it.
template <auto kFree>
struct Free {
  void operator()(auto* object) const { kFree(&object); }
};
struct FreeIo {
  void operator()(AVIOContext* io) const {
    av_freep(&io->buffer);
    avio_context_free(&io);
  }
};
struct FreeFormat {
  void operator()(AVFormatContext* format) const { avformat_free_context(format); }
};

using AvFrame = std::unique_ptr<AVFrame, Free<av_frame_free>>;
using AvPacket = std::unique_ptr<AVPacket, Free<av_packet_free>>;
using AvCodec = std::unique_ptr<AVCodecContext, Free<avcodec_free_context>>;
using AvIo = std::unique_ptr<AVIOContext, FreeIo>;
using AvInput = std::unique_ptr<AVFormatContext, Free<avformat_close_input>>;
using AvOutput = std::unique_ptr<AVFormatContext, FreeFormat>;

[[nodiscard]] inline std::string av_reason(int error) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(error, text, sizeof text);
  return text;
}

/// Lets FFmpeg read or write an open descriptor instead of a named file. Lifetime: the descriptor
/// stays its owner's and must outlive the result. Throws Error(Failed).
[[nodiscard]] AvIo make_io(const int& fd, bool writes);

}  // namespace lenticule::video
