// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/hardware_pictures.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>

namespace lenticule::video {
namespace {

struct Codec {
  AVCodecID id;
  uint32_t fourcc;
  const char* decoder;
};
constexpr std::array<Codec, 6> kCodecs = {{
    {AV_CODEC_ID_H264, V4L2_PIX_FMT_H264, "h264_v4l2m2m"},
    {AV_CODEC_ID_HEVC, V4L2_PIX_FMT_HEVC, "hevc_v4l2m2m"},
    {AV_CODEC_ID_VP8, V4L2_PIX_FMT_VP8, "vp8_v4l2m2m"},
    {AV_CODEC_ID_VP9, V4L2_PIX_FMT_VP9, "vp9_v4l2m2m"},
    {AV_CODEC_ID_MPEG4, V4L2_PIX_FMT_MPEG4, "mpeg4_v4l2m2m"},
    {AV_CODEC_ID_MPEG2VIDEO, V4L2_PIX_FMT_MPEG2, "mpeg2_v4l2m2m"},
}};

/// Sizes of the blocks that the last ones of a picture are filled up to.
constexpr std::array kBlocks = {1, 8, 16, 32, 64};

bool holds(const CodedFormat& format, const AVCodecParameters& stream) {
  const auto fits = [](int size, uint32_t most) {
    return size > 0 && (most == 0 || static_cast<uint32_t>(size) <= most);
  };
  return fits(stream.width, format.most_width) && fits(stream.height, format.most_height);
}

bool decodes(const HardwareDecoder& decoder, uint32_t fourcc, const AVCodecParameters& stream) {
  return std::ranges::any_of(decoder.formats, [&](const CodedFormat& format) {
    return format.fourcc == fourcc && holds(format, stream);
  });
}

bool is_filled_up(int size, int stated) {
  return std::ranges::any_of(
      kBlocks, [&](int block) { return size == (stated + block - 1) / block * block; });
}

/// Returns true if `bytes` bytes at `data` lie in one of the frame's buffers.
bool is_inside(const AVFrame& frame, const uint8_t* data, size_t bytes) {
  return std::ranges::any_of(frame.buf, [&](const AVBufferRef* buffer) {
    if (buffer == nullptr || data < buffer->data) return false;
    const auto offset = static_cast<size_t>(data - buffer->data);
    return offset <= buffer->size && bytes <= buffer->size - offset;
  });
}

/// Returns true if each plane of the 4:2:0 picture lies in the memory that the driver gave.
bool has_its_memory(const AVFrame& frame) {
  const bool packed = frame.format == AV_PIX_FMT_NV12;
  const int half_width = (frame.width + 1) / 2;
  const int half_height = (frame.height + 1) / 2;
  const std::array<int, 3> bytes = {frame.width, packed ? 2 * half_width : half_width, half_width};
  const std::array<int, 3> rows = {frame.height, half_height, half_height};
  for (size_t plane = 0; plane < (packed ? 2U : 3U); ++plane) {
    const int stride = frame.linesize[plane];
    if (frame.data[plane] == nullptr || stride < bytes[plane]) return false;
    const size_t all = static_cast<size_t>(stride) * static_cast<size_t>(rows[plane] - 1) +
                       static_cast<size_t>(bytes[plane]);
    if (!is_inside(frame, frame.data[plane], all)) return false;
  }
  return true;
}

}  // namespace

HardwareChoice choose_hardware(const AVCodecParameters& stream,
                               const std::vector<HardwareDecoder>& found) {
  const char* const name = avcodec_get_name(stream.codec_id);
  const auto* const codec =
      std::ranges::find_if(kCodecs, [&](const Codec& one) { return one.id == stream.codec_id; });
  if (codec == kCodecs.end())
    return {.decoder = {}, .obstacle = fmt::format("{} is not decoded in hardware", name)};
  if (stream.format != AV_PIX_FMT_YUV420P && stream.format != AV_PIX_FMT_YUVJ420P)
    return {.decoder = {}, .obstacle = "hardware decodes 4:2:0 of 8 bits only"};
  for (const HardwareDecoder& decoder : found)
    if (decodes(decoder, codec->fourcc, stream)) return {.decoder = codec->decoder, .obstacle = {}};
  return {.decoder = {},
          .obstacle = fmt::format("no device decodes {} of {}x{} pixels", name, stream.width,
                                  stream.height)};
}

std::string adopt_picture(AVFrame& frame, const AVCodecParameters& stream) {
  if (frame.format != AV_PIX_FMT_YUV420P && frame.format != AV_PIX_FMT_NV12)
    return "its pictures are neither yuv420p nor nv12";
  if (frame.decode_error_flags != 0 || (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0)
    return "it reports a damaged picture";
  if (!is_filled_up(frame.width, stream.width) || !is_filled_up(frame.height, stream.height))
    return fmt::format("its picture has {}x{} pixels instead of {}x{}", frame.width, frame.height,
                       stream.width, stream.height);
  frame.width = stream.width;
  frame.height = stream.height;
  if (!has_its_memory(frame)) return "its picture is not whole";
  frame.colorspace = AVCOL_SPC_UNSPECIFIED;
  frame.color_range = AVCOL_RANGE_UNSPECIFIED;
  frame.color_trc = AVCOL_TRC_UNSPECIFIED;
  frame.chroma_location = AVCHROMA_LOC_UNSPECIFIED;
  return {};
}

}  // namespace lenticule::video
