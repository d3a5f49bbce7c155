// SPDX-License-Identifier: Apache-2.0
// Includes FFmpeg's headers, and hides what differs between its versions 5.1, 7.1 and later. No
// other file asks for FFmpeg's version.
#pragma once

// NOLINTBEGIN
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wpedantic"
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/avstring.h>
#include <libavutil/imgutils.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libavutil/stereo3d.h>
#include <libswresample/swresample.h>
}
#pragma GCC diagnostic pop
// NOLINTEND

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>

namespace lenticule::video {

/// The bytes that a writer of AVIOContext gets.
#if LIBAVFORMAT_VERSION_MAJOR >= 61
using AvioBytes = const uint8_t;
#else
using AvioBytes = uint8_t;
#endif

[[nodiscard]] inline bool is_key_frame(const AVFrame& frame) {
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(58, 7, 100)
  return (frame.flags & AV_FRAME_FLAG_KEY) != 0;
#else
  return frame.key_frame != 0;
#endif
}

/// Returns the time that the frame stays, in units of its time stamp; 0 if it is unknown.
[[nodiscard]] inline int64_t duration_of(const AVFrame& frame) {
#if LIBAVUTIL_VERSION_MAJOR >= 58
  return frame.duration;
#else
  return frame.pkt_duration;
#endif
}

/// Gives a number to the packet that is sent next; the decoder hands it on to the packet's frame.
inline void number_packet(AVCodecContext& codec, AVPacket& packet, int64_t number) {
#if LIBAVCODEC_VERSION_MAJOR >= 60
  codec.flags |= AV_CODEC_FLAG_COPY_OPAQUE;
  packet.opaque = std::bit_cast<void*>(number);
#else
  static_cast<void>(packet);
  codec.reordered_opaque = number;
#endif
}

[[nodiscard]] inline int64_t packet_number(const AVFrame& frame) {
#if LIBAVCODEC_VERSION_MAJOR >= 60
  return std::bit_cast<int64_t>(frame.opaque);
#else
  return frame.reordered_opaque;
#endif
}

/// Returns what the container says about a whole stream; empty if it says nothing.
[[nodiscard]] inline std::span<const uint8_t> side_data(const AVStream& stream,
                                                        AVPacketSideDataType type) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 29, 100)
  const AVCodecParameters& about = *stream.codecpar;
  const AVPacketSideData* const found =
      av_packet_side_data_get(about.coded_side_data, about.nb_coded_side_data, type);
  if (found == nullptr) return {};
  return {found->data, found->size};
#else
  size_t bytes = 0;
  const uint8_t* const data = av_stream_get_side_data(&stream, type, &bytes);
  if (data == nullptr) return {};
  return {data, bytes};
#endif
}

/// Returns the number of the frame's view in a stream of several (MV-HEVC); otherwise -1.
[[nodiscard]] inline int view_number(const AVFrame& frame) {
  int number = -1;
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(59, 38, 100)
  if (const AVFrameSideData* const data = av_frame_get_side_data(&frame, AV_FRAME_DATA_VIEW_ID))
    std::memcpy(&number, data->data, sizeof number);
#else
  static_cast<void>(frame);
#endif
  return number;
}

/// Returns the pixel formats that an encoder takes; empty if it does not say.
[[nodiscard]] inline std::span<const AVPixelFormat> encoder_formats(const AVCodec& encoder) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(61, 13, 100)
  const void* formats = nullptr;
  int count = 0;
  if (avcodec_get_supported_config(nullptr, &encoder, AV_CODEC_CONFIG_PIX_FORMAT, 0, &formats,
                                   &count) < 0 ||
      formats == nullptr)
    return {};
  return {static_cast<const AVPixelFormat*>(formats), static_cast<size_t>(count)};
#else
  size_t count = 0;
  while (encoder.pix_fmts != nullptr && encoder.pix_fmts[count] != AV_PIX_FMT_NONE) ++count;
  return {encoder.pix_fmts, count};
#endif
}

}  // namespace lenticule::video
