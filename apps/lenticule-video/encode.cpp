// SPDX-License-Identifier: Apache-2.0
// lenticule-video encode encodes raw frames from standard input into a lossless Matroska file.
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/confinement.h"
#include "apps/lenticule-video/pixel_convert.h"
#include "apps/lenticule-video/stream_pixels.h"
#include "apps/lenticule-video/subcommands.h"
#include "base/error.h"
#include "base/temporary.h"
#include "frames/rational.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::video {
namespace {

constexpr int kThreads = 4;
/// FFV1 does not support every number of slices for small pictures.
constexpr int kSlicedSide = 256;
constexpr int kFfv1Version = 3;  ///< first version with slices and their checksums

[[noreturn]] void cannot_write(const std::string& file, const std::string& cause) {
  throw Error(ErrorKind::Failed, file + ": cannot write: " + cause);
}

void must(int result, const std::string& file) {
  if (result < 0) cannot_write(file, av_reason(result));
}

AVPixelFormat input_format(const EncodeRequest& request) {
  const AVPixelFormat format = av_get_pix_fmt(request.pixels.c_str());
  if (format != AV_PIX_FMT_NONE) return format;
  throw Error(ErrorKind::Usage, "--pixels: unknown pixel format '" + request.pixels + "'",
              "for example rgb24, gbrp16le, yuv444p");
}

/// Returns the encoder's format: the input's own, or for 8-bit RGB any order of channels.
AVPixelFormat encoder_format(const AVCodec& encoder, AVPixelFormat input) {
  const auto takes = [&encoder](AVPixelFormat wanted) {
    const std::span<const AVPixelFormat> formats = encoder_formats(encoder);
    return std::ranges::find(formats, wanted) != formats.end();
  };
  if (takes(input)) return input;
  if (input == AV_PIX_FMT_RGB24)
    for (const AVPixelFormat other : {AV_PIX_FMT_GBRP, AV_PIX_FMT_BGR0, AV_PIX_FMT_RGB24})
      if (takes(other)) return other;
  throw Error(ErrorKind::Usage, fmt::format("--pixels: {} does not support {}", encoder.name,
                                            av_get_pix_fmt_name(input)));
}

/// Reads all of `bytes` from standard input; returns false at its end. Throws if the input ends
/// within a frame.
bool read_frame(std::span<uint8_t> bytes) {
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(STDIN_FILENO, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0)
      throw Error(ErrorKind::Failed, std::string("standard input: ") + std::strerror(errno));
    if (n == 0 && done == 0) return false;
    if (n == 0) throw Error(ErrorKind::Input, "standard input: ends within a frame");
    done += static_cast<size_t>(n);
  }
  return true;
}

class Encoder {
 public:
  Encoder(const EncodeRequest& request, const int& fd);
  void encode(std::span<const uint8_t> pixels);
  void finish();
  [[nodiscard]] int64_t frames() const { return frames_; }

 private:
  void open_codec(const AVCodec& codec);
  void set_colour();
  void fill(std::span<const uint8_t> pixels);
  void send(const AVFrame* frame);

  const EncodeRequest& request_;
  AVPixelFormat input_;
  AvIo io_;
  AvOutput format_;
  AvCodec codec_;
  AvFrame frame_;
  AvPacket packet_;
  AVStream* stream_ = nullptr;
  int64_t frames_ = 0;
};

Encoder::Encoder(const EncodeRequest& request, const int& fd)
    : request_(request),
      input_(input_format(request)),
      io_(make_io(fd, true)),
      frame_(av_frame_alloc()),
      packet_(av_packet_alloc()) {
  const bool x264 = request.codec == "x264rgb";
  const AVCodec* const codec = avcodec_find_encoder_by_name(x264 ? "libx264rgb" : "ffv1");
  if (codec == nullptr)
    throw Error(ErrorKind::Failed, "encoder " + request.codec + ": not in this FFmpeg", "use ffv1");
  AVFormatContext* format = nullptr;
  must(avformat_alloc_output_context2(&format, nullptr, "matroska", nullptr), request.file);
  format_.reset(format);
  format->pb = io_.get();
  format->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
  stream_ = avformat_new_stream(format, nullptr);
  if (stream_ == nullptr || !frame_ || !packet_)
    throw Error(ErrorKind::Failed, "video: out of memory");
  open_codec(*codec);
  must(avcodec_parameters_from_context(stream_->codecpar, codec_.get()), request.file);
  stream_->time_base = codec_->time_base;
  stream_->avg_frame_rate = codec_->framerate;
  must(avformat_write_header(format, nullptr), request.file);
}

void Encoder::open_codec(const AVCodec& codec) {
  const frames::Rate rate = frames::parse_rate(request_.rate);
  codec_.reset(avcodec_alloc_context3(&codec));
  codec_->width = request_.width;
  codec_->height = request_.height;
  codec_->pix_fmt = encoder_format(codec, input_);
  codec_->time_base = {static_cast<int>(rate.denominator), static_cast<int>(rate.numerator)};
  codec_->framerate = {static_cast<int>(rate.numerator), static_cast<int>(rate.denominator)};
  codec_->thread_count = kThreads;
  codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_BITEXACT;
  codec_->gop_size = request_.codec == "ffv1" ? 1 : codec_->gop_size;
  if (request_.codec == "ffv1") {
    codec_->level = kFfv1Version;
    if (request_.width >= kSlicedSide && request_.height >= kSlicedSide) codec_->slices = kThreads;
    (void)av_opt_set_int(codec_->priv_data, "slicecrc", 1, 0);
  } else {
    (void)av_opt_set(codec_->priv_data, "preset", "veryfast", 0);
    (void)av_opt_set(codec_->priv_data, "tune", "fastdecode", 0);
    must(av_opt_set_int(codec_->priv_data, "qp", 0, 0), request_.file);
  }
  set_colour();
  must(avcodec_open2(codec_.get(), &codec, nullptr), request_.file);
}

void Encoder::set_colour() {
  const auto look_up = [](const std::string& text, int (*find)(const char*), const char* flag) {
    const int value = find(text.c_str());
    if (value < 0) throw Error(ErrorKind::Usage, fmt::format("{}: no '{}'", flag, text));
    return value;
  };
  const auto& [matrix, range, transfer] =
      std::tie(request_.matrix, request_.range, request_.transfer);
  if (!matrix.empty())
    codec_->colorspace =
        static_cast<AVColorSpace>(look_up(matrix, av_color_space_from_name, "--matrix"));
  if (!range.empty())
    codec_->color_range =
        static_cast<AVColorRange>(look_up(range, av_color_range_from_name, "--range"));
  if (!transfer.empty())
    codec_->color_trc = static_cast<AVColorTransferCharacteristic>(
        look_up(transfer, av_color_transfer_from_name, "--transfer"));
}

/// Copies tightly packed pixels of the input's format into frame_.
void Encoder::fill(std::span<const uint8_t> pixels) {
  av_frame_unref(frame_.get());
  frame_->width = request_.width;
  frame_->height = request_.height;
  frame_->format = codec_->pix_fmt;
  must(av_frame_get_buffer(frame_.get(), 0), request_.file);
  AVFrame& out = *frame_;
  if (codec_->pix_fmt == input_) {
    std::array<uint8_t*, 4> data{};
    std::array<int, 4> lines{};
    must(av_image_fill_arrays(data.data(), lines.data(), pixels.data(), input_, out.width,
                              out.height, 1),
         request_.file);
    std::array<const uint8_t*, 4> from{};
    std::copy(data.begin(), data.end(), from.begin());
    av_image_copy(out.data, out.linesize, from.data(), lines.data(), input_, out.width, out.height);
    return;
  }
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

void Encoder::encode(std::span<const uint8_t> pixels) {
  fill(pixels);
  frame_->pts = frames_++;
  send(frame_.get());
}

void Encoder::send(const AVFrame* frame) {
  must(avcodec_send_frame(codec_.get(), frame), request_.file);
  while (true) {
    const int error = avcodec_receive_packet(codec_.get(), packet_.get());
    if (error == AVERROR(EAGAIN) || error == AVERROR_EOF) return;
    must(error, request_.file);
    packet_->stream_index = stream_->index;
    packet_->duration = 1;
    av_packet_rescale_ts(packet_.get(), codec_->time_base, stream_->time_base);
    must(av_interleaved_write_frame(format_.get(), packet_.get()), request_.file);
  }
}

void Encoder::finish() {
  send(nullptr);
  must(av_write_trailer(format_.get()), request_.file);
  avio_flush(io_.get());
  must(io_->error, request_.file);
}

/// OutputFile is a file that gets its name when it is complete.
class OutputFile {
 public:
  explicit OutputFile(const std::string& name) : name_(name) {
    if (name_ == "-") return;
    file_.emplace(name_);
  }

  [[nodiscard]] int fd() const { return file_ ? file_->fd() : STDOUT_FILENO; }
  void keep() {
    if (file_) return file_->replace_target();
    if (fsync(STDOUT_FILENO) != 0) cannot_write(name_, std::strerror(errno));
  }

 private:
  std::string name_;
  std::optional<TemporaryFile> file_;
};

void check(const EncodeRequest& request) {
  const frames::FrameGeometry size{.width = request.width, .height = request.height};
  if (const char* problem = frames::geometry_problem(size, frames::kMinSlots))
    throw Error(ErrorKind::Usage, std::string("--size: ") + problem);
  struct stat status {};
  if (request.file == "-" && (fstat(STDOUT_FILENO, &status) != 0 || !S_ISREG(status.st_mode)))
    throw Error(ErrorKind::Usage, "-: standard output is not a file",
                "writing Matroska needs seeking");
}

}  // namespace

int run_encode(const EncodeRequest& request) {
  if (request.parent > 0 && !die_with(request.parent)) return 1;
  std::signal(SIGXFSZ, SIG_IGN);
  check(request);
  const int bytes =
      av_image_get_buffer_size(input_format(request), request.width, request.height, 1);
  if (bytes <= 0) throw Error(ErrorKind::Usage, "--size: cannot be combined with these --pixels");
  std::vector<uint8_t> pixels(static_cast<size_t>(bytes));
  OutputFile output(request.file);
  const int fd = output.fd();
  Encoder encoder(request, fd);
  while (read_frame(pixels)) encoder.encode(pixels);
  if (encoder.frames() == 0) throw Error(ErrorKind::Input, "standard input: no frame");
  encoder.finish();
  output.keep();
  return 0;
}

}  // namespace lenticule::video
