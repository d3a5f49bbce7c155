// SPDX-License-Identifier: Apache-2.0
// lenticule-video probe reports the streams of a file as JSON.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string_view>

#include "apps/lenticule-video/clip_reader.h"
#include "apps/lenticule-video/confinement.h"
#include "apps/lenticule-video/subcommands.h"
#include "base/error.h"
#include "base/print.h"
#include "base/unique_fd.h"

namespace lenticule::video {
namespace {

using nlohmann::json;

constexpr uint64_t kMemoryBytes = uint64_t{2} << 30;
constexpr unsigned kSeconds = 20;

json rational(AVRational value) {
  if (value.num <= 0 || value.den <= 0) return nullptr;
  return json::array({value.num, value.den});
}

json text_or_null(const char* text) { return text != nullptr ? json(text) : json(nullptr); }

/// Returns the duration in seconds; null if neither the stream nor the container states it.
json duration(const AVFormatContext& format, const AVStream& stream) {
  if (stream.duration > 0) return static_cast<double>(stream.duration) * av_q2d(stream.time_base);
  if (format.duration > 0) return static_cast<double>(format.duration) / AV_TIME_BASE;
  return nullptr;
}

/// Returns the EXIF number of the orientation, or null for angles other than quarter turns.
json orientation(const AVStream& stream) {
  const std::span<const uint8_t> data = side_data(stream, AV_PKT_DATA_DISPLAYMATRIX);
  if (data.size() < 9 * sizeof(int32_t)) return 1;
  std::array<int32_t, 9> m{};
  std::memcpy(m.data(), data.data(), sizeof m);
  struct Turn {
    int a, b, c, d;
    int orientation;
  };
  constexpr std::array<Turn, 8> kTurns = {{{1, 0, 0, 1, 1},
                                           {-1, 0, 0, 1, 2},
                                           {-1, 0, 0, -1, 3},
                                           {1, 0, 0, -1, 4},
                                           {0, 1, 1, 0, 5},
                                           {0, 1, -1, 0, 6},
                                           {0, -1, -1, 0, 7},
                                           {0, -1, 1, 0, 8}}};
  constexpr int kOne = 1 << 16;
  for (const Turn& turn : kTurns)
    if (m[0] == turn.a * kOne && m[1] == turn.b * kOne && m[3] == turn.c * kOne &&
        m[4] == turn.d * kOne)
      return turn.orientation;
  return nullptr;
}

json described(const AVStereo3D& tag, bool half) {
  if (tag.type == AV_STEREO3D_2D) return nullptr;
  return {{"layout", av_stereo3d_type_name(tag.type)},
          {"right_first", (tag.flags & AV_STEREO3D_FLAG_INVERT) != 0},
          {"half", half}};
}

/// Returns the tag that H.264 and HEVC give their pictures (the SEI message "frame packing
/// arrangement"), which is in the decoded picture only. Such pictures are squeezed, unless they are
/// as wide or as high as two.
json packed_stereo(const int& fd, const std::string& file, const AVStream& stream) {
  const AVCodecParameters& p = *stream.codecpar;
  if (p.codec_id != AV_CODEC_ID_H264 && p.codec_id != AV_CODEC_ID_HEVC) return nullptr;
  try {
    ClipReader reader(fd, file, {.stream = stream.index});
    if (reader.next() == ClipReader::Step::End) return nullptr;
    const AVFrameSideData* const data =
        av_frame_get_side_data(&reader.frame(), AV_FRAME_DATA_STEREO3D);
    AVStereo3D tag{};
    if (data == nullptr || data->size < sizeof tag) return nullptr;
    std::memcpy(&tag, data->data, sizeof tag);
    const double aspect = static_cast<double>(p.width) / std::max(p.height, 1);
    return described(tag, tag.type == AV_STEREO3D_TOPBOTTOM ? aspect > 1.25 : aspect < 2.5);
  } catch (const Error&) {
    return nullptr;  // playing reports the reason
  }
}

/// Returns {"layout": "side by side", "right_first": ..., "half": ...}, or null if there is no tag.
/// Two views are delivered with that of the left eye on the left.
json stereo(const AVStream& stream, bool two_views) {
  if (two_views) return {{"layout", "side by side"}, {"right_first", false}, {"half", false}};
  // The container's tag describes the view that is not decoded.
  if (has_second_layer(*stream.codecpar)) return nullptr;
  const std::span<const uint8_t> data = side_data(stream, AV_PKT_DATA_STEREO3D);
  const AVDictionaryEntry* const mode = av_dict_get(stream.metadata, "stereo_mode", nullptr, 0);
  if (data.size() < sizeof(AVStereo3D)) {
    if (mode == nullptr || std::string_view(mode->value) == "mono") return nullptr;
    return {{"layout", mode->value}, {"right_first", false}, {"half", false}};
  }
  AVStereo3D tag{};
  std::memcpy(&tag, data.data(), sizeof tag);
  return described(tag, false);  // the shape of the pixels shows whether the eyes are squeezed
}

/// Returns what is lost when the stream is played; null if nothing is.
json warning(const AVStream& stream, bool two_views) {
  if (two_views || !has_second_layer(*stream.codecpar)) return nullptr;
  return fmt::format(
      "FFmpeg {} does not decode its second layer, the other eye of MV-HEVC: play it on Debian 13, "
      "which has FFmpeg 7.1, or convert it to side by side; --grid 1x1 shows one eye's picture "
      "flat",
      av_version_info());
}

/// Returns the rate at which the stream's time stamps are followed: the lowest on which they lie,
/// or a multiple of it for a film that has more frames. Without such a rate FFmpeg states the
/// clock's.
AVRational rate_of(const AVStream& stream) {
  constexpr AVRational kForAnyTimes{60, 1};
  const AVRational average = stream.avg_frame_rate, lowest = stream.r_frame_rate;
  if (average.num <= 0 || average.den <= 0) return lowest;
  if (lowest.num <= 0 || lowest.den <= 0) return average;
  const double ratio = av_q2d(average) / av_q2d(lowest);
  if (av_cmp_q(lowest, {120, 1}) > 0 && ratio < 0.6)
    return av_cmp_q(average, kForAnyTimes) > 0 ? average : kForAnyTimes;
  // The average also counts frames that an edit list hides.
  return av_mul_q(lowest, {static_cast<int>(std::ceil(std::clamp(ratio - 0.1, 1.0, 100.0))), 1});
}

/// Returns the reason why the stream cannot be decoded, or null.
json refusal(const AVCodecParameters& stream, const PixelVerdict& verdict) {
  if (verdict.layout) return nullptr;
  const std::string obstacle = codec_obstacle(stream);
  if (!obstacle.empty()) return obstacle;
  return fmt::format("{} (codec {})", verdict.refusal, avcodec_get_name(stream.codec_id));
}

json describe(const int& fd, const std::string& file, AVFormatContext& format, AVStream& stream) {
  const AVCodecParameters& p = *stream.codecpar;
  const PixelVerdict verdict = evaluate_pixels(tags_of(p));
  const bool two_views = decodes_two_views(stream);
  const std::optional<ExpectedFrames> expected = expected_frames(format, stream);
  json tag = stereo(stream, two_views);
  if (tag.is_null() && !has_second_layer(p)) tag = packed_stereo(fd, file, stream);
  const AVRational aspect = av_guess_sample_aspect_ratio(&format, &stream, nullptr);
  return {{"index", stream.index},
          {"codec", avcodec_get_name(p.codec_id)},
          {"width", p.width},
          {"height", p.height},
          {"rate", rational(rate_of(stream))},
          {"frames", stream.nb_frames > 0 ? json(stream.nb_frames) : json(nullptr)},
          {"expected_frames", expected ? json(expected->frames) : json(nullptr)},
          {"orientation", orientation(stream)},
          {"views", two_views ? 2 : 1},
          {"stereo", tag},
          {"duration_s", duration(format, stream)},
          {"pixel_format", text_or_null(av_get_pix_fmt_name(static_cast<AVPixelFormat>(p.format)))},
          {"colour_space", text_or_null(av_color_space_name(p.color_space))},
          {"transfer", text_or_null(av_color_transfer_name(p.color_trc))},
          {"range", text_or_null(av_color_range_name(p.color_range))},
          {"sample_aspect", rational(aspect)},
          {"sampling", verdict.sampling},
          {"depth", verdict.depth},
          {"exact", verdict.exact},
          {"full_chroma", verdict.layout && !verdict.layout->subsampled()},
          {"warning", warning(stream, two_views)},
          {"refusal", refusal(p, verdict)}};
}

json describe_sound(const AVFormatContext& format, const AVStream& stream) {
  const AVCodecParameters& p = *stream.codecpar;
  const auto tag = [&](const char* key) {
    const AVDictionaryEntry* const entry = av_dict_get(stream.metadata, key, nullptr, 0);
    return text_or_null(entry != nullptr ? entry->value : nullptr);
  };
  const std::string obstacle = codec_obstacle(p, kSoundDecoders);
  return {{"index", stream.index},
          {"codec", avcodec_get_name(p.codec_id)},
          {"language", tag("language")},
          {"duration_s", duration(format, stream)},
          {"refusal", obstacle.empty() ? json(nullptr) : json(obstacle)}};
}

}  // namespace

int run_probe(const std::string& file) {
  const UniqueFd input(open_clip_file(file));
  alarm(kSeconds);  // ends the program if parsing the file takes longer
  confine(kMemoryBytes);
  const int fd = input.get();
  Container container(fd, file, true);
  AVFormatContext& format = container.format();
  json streams = json::array(), sound = json::array();
  for (unsigned i = 0; i < format.nb_streams; ++i) {
    AVStream& stream = *format.streams[i];
    if (stream.codecpar->codec_type == AVMEDIA_TYPE_AUDIO)
      sound.push_back(describe_sound(format, stream));
    if (stream.codecpar->codec_type != AVMEDIA_TYPE_VIDEO) continue;
    if ((stream.disposition & AV_DISPOSITION_ATTACHED_PIC) != 0) continue;
    streams.push_back(describe(fd, file, format, stream));
  }
  const json report = {{"container", format.iformat->name}, {"streams", streams}, {"sound", sound}};
  print_out("{}\n", Verbatim{json_text(report, 2)});
  return 0;
}

}  // namespace lenticule::video
