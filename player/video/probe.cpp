// SPDX-License-Identifier: Apache-2.0
// lenticule-video probe: what is in a file, as JSON.
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "base/print.h"
#include "base/unique_fd.h"
#include "player/video/clip_reader.h"
#include "player/video/confinement.h"
#include "player/video/subcommands.h"

namespace lenticule::video {
namespace {

using nlohmann::json;

constexpr uint64_t kMemoryBytes = uint64_t{2} << 30;
constexpr unsigned kSeconds = 20;

json rational(AVRational value) {
  if (value.num <= 0 || value.den <= 0) return nullptr;
  return json::array({value.num, value.den});
}

json text_or_null(const char* text) {
  return text != nullptr ? json(text) : json(nullptr);
}

/// Seconds; null where neither the stream nor the container knows.
json duration(const AVFormatContext& format, const AVStream& stream) {
  if (stream.duration > 0) return static_cast<double>(stream.duration) * av_q2d(stream.time_base);
  if (format.duration > 0) return static_cast<double>(format.duration) / AV_TIME_BASE;
  return nullptr;
}

AVRational rate_of(const AVStream& stream) {
  return stream.avg_frame_rate.num > 0 ? stream.avg_frame_rate : stream.r_frame_rate;
}

json describe(AVFormatContext& format, AVStream& stream) {
  const AVCodecParameters& p = *stream.codecpar;
  const PixelVerdict verdict = judge_pixels(tags_of(p));
  const AVRational aspect = av_guess_sample_aspect_ratio(&format, &stream, nullptr);
  return {{"index", stream.index},
          {"codec", avcodec_get_name(p.codec_id)},
          {"width", p.width},
          {"height", p.height},
          {"rate", rational(rate_of(stream))},
          {"frames", stream.nb_frames > 0 ? json(stream.nb_frames) : json(nullptr)},
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
          {"refusal", verdict.layout ? json(nullptr) : json(verdict.refusal)}};
}

}  // namespace

int run_probe(const std::string& file) {
  const UniqueFd input(open_clip_file(file));
  alarm(kSeconds);  // a file that takes longer to understand ends the program
  confine(kMemoryBytes);
  const int fd = input.get();
  Container container(fd, file);
  AVFormatContext& format = container.format();
  json streams = json::array();
  for (unsigned i = 0; i < format.nb_streams; ++i) {
    AVStream& stream = *format.streams[i];
    if (stream.codecpar->codec_type != AVMEDIA_TYPE_VIDEO) continue;
    if ((stream.disposition & AV_DISPOSITION_ATTACHED_PIC) != 0) continue;
    streams.push_back(describe(format, stream));
  }
  const json report = {{"container", format.iformat->name}, {"streams", streams}};
  print_out("{}\n", Verbatim{json_text(report, 2)});
  return 0;
}

}  // namespace lenticule::video
