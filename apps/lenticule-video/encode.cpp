// SPDX-License-Identifier: Apache-2.0
// lenticule-video encode encodes raw frames from standard input into a lossless Matroska file,
// which is its standard output.
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <span>
#include <vector>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/confinement.h"
#include "apps/lenticule-video/pixel_convert.h"
#include "apps/lenticule-video/stream_pixels.h"
#include "apps/lenticule-video/subcommands.h"
#include "base/error_kinds.h"
#include "frames/rational.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::video {
namespace {

constexpr int kThreads = 4;
/// FFV1 does not support every number of slices for small pictures.
constexpr int kSlicedSide = 256;
constexpr int kFfv1Version = 3;  ///< first version with slices and their checksums

[[noreturn]] void cannot_write(const std::string& cause) {
  throw failed_error("standard output: cannot write: {}", cause);
}

void must(int result) {
  if (result < 0) cannot_write(av_reason(result));
}

/// Returns the encoder's format of 8-bit RGB.
AVPixelFormat encoder_format(const AVCodec& encoder) {
  const std::span<const AVPixelFormat> formats = encoder_formats(encoder);
  for (const AVPixelFormat wanted : {AV_PIX_FMT_GBRP, AV_PIX_FMT_BGR0, AV_PIX_FMT_RGB24})
    if (std::ranges::find(formats, wanted) != formats.end()) return wanted;
  throw failed_error("encoder {}: does not take RGB", encoder.name);
}

/// Reads all of `bytes` from standard input; returns false at its end. Throws if the input ends
/// within a frame.
bool read_frame(std::span<uint8_t> bytes) {
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(STDIN_FILENO, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw failed_error("standard input: {}", std::strerror(errno));
    if (n == 0 && done == 0) return false;
    if (n == 0) throw Error(ErrorKind::Input, "standard input: ends within a frame");
    done += static_cast<size_t>(n);
  }
  return true;
}

class Encoder {
 public:
  Encoder(const EncodeRequest& request, const int& fd)
      : request_(request),
        io_(make_io(fd, true)),
        frame_(av_frame_alloc()),
        packet_(av_packet_alloc()) {
    const bool x264 = request.codec == "x264rgb";
    const AVCodec* const codec = avcodec_find_encoder_by_name(x264 ? "libx264rgb" : "ffv1");
    if (codec == nullptr)
      throw failed_error("encoder {}: not in this FFmpeg", request.codec).remedy("use ffv1");
    AVFormatContext* format = nullptr;
    must(avformat_alloc_output_context2(&format, nullptr, "matroska", nullptr));
    format_.reset(format);
    format->pb = io_.get();
    format->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
    stream_ = avformat_new_stream(format, nullptr);
    if (stream_ == nullptr || !frame_ || !packet_)
      throw Error(ErrorKind::Failed, "video: out of memory");
    open_codec(*codec);
    must(avcodec_parameters_from_context(stream_->codecpar, codec_.get()));
    stream_->time_base = codec_->time_base;
    stream_->avg_frame_rate = codec_->framerate;
    must(avformat_write_header(format, nullptr));
  }
  void encode(std::span<const uint8_t> pixels) {
    fill(pixels);
    frame_->pts = frames_++;
    send(frame_.get());
  }
  void finish() {
    send(nullptr);
    must(av_write_trailer(format_.get()));
    avio_flush(io_.get());
    must(io_->error);
  }
  [[nodiscard]] int64_t frames() const { return frames_; }

 private:
  void open_codec(const AVCodec& codec) {
    const frames::Rate rate = frames::parse_rate(request_.rate);
    codec_.reset(avcodec_alloc_context3(&codec));
    codec_->width = request_.width;
    codec_->height = request_.height;
    codec_->pix_fmt = encoder_format(codec);
    codec_->time_base = {static_cast<int>(rate.denominator), static_cast<int>(rate.numerator)};
    codec_->framerate = {static_cast<int>(rate.numerator), static_cast<int>(rate.denominator)};
    codec_->thread_count = kThreads;
    codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_BITEXACT;
    codec_->gop_size = request_.codec == "ffv1" ? 1 : codec_->gop_size;
    if (request_.codec == "ffv1") {
      codec_->level = kFfv1Version;
      if (request_.width >= kSlicedSide && request_.height >= kSlicedSide)
        codec_->slices = kThreads;
      (void)av_opt_set_int(codec_->priv_data, "slicecrc", 1, 0);
    } else {
      (void)av_opt_set(codec_->priv_data, "preset", "veryfast", 0);
      (void)av_opt_set(codec_->priv_data, "tune", "fastdecode", 0);
      must(av_opt_set_int(codec_->priv_data, "qp", 0, 0));
    }
    must(avcodec_open2(codec_.get(), &codec, nullptr));
  }
  /// Copies tightly packed RGB into frame_.
  void fill(std::span<const uint8_t> pixels) {
    av_frame_unref(frame_.get());
    frame_->width = request_.width;
    frame_->height = request_.height;
    frame_->format = codec_->pix_fmt;
    must(av_frame_get_buffer(frame_.get(), 0));
    AVFrame& out = *frame_;
    const PixelLayout to = *evaluate_pixels({.format = codec_->pix_fmt}).layout;
    for (int row = 0; row < out.height; ++row) {
      const uint8_t* in =
          pixels.data() + static_cast<size_t>(row) * static_cast<size_t>(out.width) * 3;
      for (size_t channel = 0; channel < to.components.size(); ++channel) {
        const PixelComponent& c = to.components[channel];
        uint8_t* const line = out.data[c.plane] + ptrdiff_t{row} * out.linesize[c.plane] + c.offset;
        for (int x = 0; x < out.width; ++x)
          line[x * c.step] = in[static_cast<size_t>(x) * 3 + channel];
      }
    }
  }
  void send(const AVFrame* frame) {
    must(avcodec_send_frame(codec_.get(), frame));
    while (true) {
      const int error = avcodec_receive_packet(codec_.get(), packet_.get());
      if (error == AVERROR(EAGAIN) || error == AVERROR_EOF) return;
      must(error);
      packet_->stream_index = stream_->index;
      packet_->duration = 1;
      av_packet_rescale_ts(packet_.get(), codec_->time_base, stream_->time_base);
      must(av_interleaved_write_frame(format_.get(), packet_.get()));
    }
  }

  const EncodeRequest& request_;
  AvIo io_;
  AvOutput format_;
  AvCodec codec_;
  AvFrame frame_;
  AvPacket packet_;
  AVStream* stream_ = nullptr;
  int64_t frames_ = 0;
};

void check(const EncodeRequest& request) {
  const frames::FrameGeometry size{.width = request.width, .height = request.height};
  if (const char* problem = frames::geometry_problem(size, frames::kMinSlots))
    throw usage_error("--size: {}", problem);
  struct stat status {};
  if (fstat(STDOUT_FILENO, &status) != 0 || !S_ISREG(status.st_mode))
    throw Error(ErrorKind::Usage, "standard output: not a file", "writing Matroska needs seeking");
}

}  // namespace

int run_encode(const EncodeRequest& request) {
  if (request.parent > 0 && !die_with(request.parent)) return 1;
  std::signal(SIGXFSZ, SIG_IGN);
  check(request);
  const frames::FrameGeometry size{.width = request.width, .height = request.height};
  std::vector<uint8_t> pixels(size.frame_bytes());
  constexpr int kOutput = STDOUT_FILENO;
  Encoder encoder(request, kOutput);
  while (read_frame(pixels)) encoder.encode(pixels);
  if (encoder.frames() == 0) throw Error(ErrorKind::Input, "standard input: no frame");
  encoder.finish();
  if (fsync(kOutput) != 0) cannot_write(std::strerror(errno));
  return 0;
}

}  // namespace lenticule::video
