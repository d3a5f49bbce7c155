// SPDX-License-Identifier: Apache-2.0
// Defines one deleter for each of FFmpeg's types, and FFmpeg's reading and writing of descriptors.
#pragma once

#include <memory>
#include <string>

#include "apps/lenticule-video/ffmpeg.h"

namespace lenticule::video {

struct FreeFrame {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
struct FreePacket {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
struct FreeCodec {
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
};
struct FreeIo {
  void operator()(AVIOContext* io) const {
    av_freep(&io->buffer);
    avio_context_free(&io);
  }
};
struct CloseInput {
  void operator()(AVFormatContext* format) const { avformat_close_input(&format); }
};
struct FreeFormat {
  void operator()(AVFormatContext* format) const { avformat_free_context(format); }
};

using AvFrame = std::unique_ptr<AVFrame, FreeFrame>;
using AvPacket = std::unique_ptr<AVPacket, FreePacket>;
using AvCodec = std::unique_ptr<AVCodecContext, FreeCodec>;
using AvIo = std::unique_ptr<AVIOContext, FreeIo>;
using AvInput = std::unique_ptr<AVFormatContext, CloseInput>;
using AvOutput = std::unique_ptr<AVFormatContext, FreeFormat>;

[[nodiscard]] inline std::string av_reason(int error) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(error, text, sizeof text);
  return text;
}

// Lets FFmpeg read and write an open descriptor instead of a named file.

/// Lifetime: the descriptor stays its owner's and must outlive the result. Throws Error(Failed).
[[nodiscard]] AvIo read_descriptor(const int& fd);
[[nodiscard]] AvIo write_descriptor(const int& fd);

}  // namespace lenticule::video
