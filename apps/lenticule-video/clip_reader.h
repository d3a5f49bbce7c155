// SPDX-License-Identifier: Apache-2.0
// ClipReader decodes one video stream of a file, frame after frame in display order.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/hardware_decoders.h"
#include "apps/lenticule-video/stream_pixels.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/misnamed_file.h"

namespace lenticule::video {

// Chooses a hardware decoder for a stream, and checks the pictures that it gives.

struct HardwareChoice {
  std::string decoder;   ///< FFmpeg's name, "h264_v4l2m2m"; empty = none fits
  std::string obstacle;  ///< the reason why none fits
};

struct Codec {
  AVCodecID id;
  uint32_t fourcc;
  const char* decoder;
};
inline constexpr std::array<Codec, 6> kCodecs = {{
    {AV_CODEC_ID_H264, V4L2_PIX_FMT_H264, "h264_v4l2m2m"},
    {AV_CODEC_ID_HEVC, V4L2_PIX_FMT_HEVC, "hevc_v4l2m2m"},
    {AV_CODEC_ID_VP8, V4L2_PIX_FMT_VP8, "vp8_v4l2m2m"},
    {AV_CODEC_ID_VP9, V4L2_PIX_FMT_VP9, "vp9_v4l2m2m"},
    {AV_CODEC_ID_MPEG4, V4L2_PIX_FMT_MPEG4, "mpeg4_v4l2m2m"},
    {AV_CODEC_ID_MPEG2VIDEO, V4L2_PIX_FMT_MPEG2, "mpeg2_v4l2m2m"},
}};

/// Sizes of the blocks that the last ones of a picture are filled up to.
inline constexpr std::array kBlocks = {1, 8, 16, 32, 64};

inline bool holds(const CodedFormat& format, const AVCodecParameters& stream) {
  const auto fits = [](int size, uint32_t most) {
    return size > 0 && (most == 0 || static_cast<uint32_t>(size) <= most);
  };
  return fits(stream.width, format.most_width) && fits(stream.height, format.most_height);
}

inline bool decodes(const HardwareDecoder& decoder, uint32_t fourcc,
                    const AVCodecParameters& stream) {
  return std::ranges::any_of(decoder.formats, [&](const CodedFormat& format) {
    return format.fourcc == fourcc && holds(format, stream);
  });
}

inline bool is_filled_up(int size, int stated) {
  return std::ranges::any_of(
      kBlocks, [&](int block) { return size == (stated + block - 1) / block * block; });
}

/// Returns true if `bytes` bytes at `data` lie in one of the frame's buffers.
inline bool is_inside(const AVFrame& frame, const uint8_t* data, size_t bytes) {
  return std::ranges::any_of(frame.buf, [&](const AVBufferRef* buffer) {
    if (buffer == nullptr || data < buffer->data) return false;
    const auto offset = static_cast<size_t>(data - buffer->data);
    return offset <= buffer->size && bytes <= buffer->size - offset;
  });
}

/// Returns true if each plane of the 4:2:0 picture lies in the memory that the driver gave.
inline bool has_its_memory(const AVFrame& frame) {
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

/// Returns true if the stream is HEVC with a second layer, as films of two views are (MV-HEVC).
[[nodiscard]] inline bool has_second_layer(const AVCodecParameters& stream) {
  // A video parameter set begins with 0x40 0x01, a number of 4 bits and 2 flags, the number of
  // layers minus 1 in 6 bits, 4 bits about sub-layers, and 0xffff (ITU-T H.265, 7.3.2.1).
  const auto head = std::span(stream.extradata, static_cast<size_t>(stream.extradata_size));
  if (stream.codec_id != AV_CODEC_ID_HEVC) return false;
  for (size_t i = 0; i + 6 <= head.size(); ++i)
    if (head[i] == 0x40 && head[i + 1] == 1 && head[i + 4] == 0xff && head[i + 5] == 0xff)
      return (head[i + 2] & 3) != 0 || head[i + 3] >> 4 != 0;
  return false;
}

/// Chooses the decoder of the stream. Hardware decoders give 4:2:0 of 8 bits.
inline HardwareChoice choose_hardware(const AVCodecParameters& stream,
                                      const std::vector<HardwareDecoder>& found) {
  const char* const name = avcodec_get_name(stream.codec_id);
  const auto* const codec =
      std::ranges::find_if(kCodecs, [&](const Codec& one) { return one.id == stream.codec_id; });
  if (codec == kCodecs.end())
    return {.decoder = {}, .obstacle = fmt::format("{} is not decoded in hardware", name)};
  if (has_second_layer(stream))
    return {.decoder = {}, .obstacle = "hardware decodes one of two views only"};
  if (stream.format != AV_PIX_FMT_YUV420P && stream.format != AV_PIX_FMT_YUVJ420P)
    return {.decoder = {}, .obstacle = "hardware decodes 4:2:0 of 8 bits only"};
  for (const HardwareDecoder& decoder : found)
    if (decodes(decoder, codec->fourcc, stream)) return {.decoder = codec->decoder, .obstacle = {}};
  return {.decoder = {},
          .obstacle = fmt::format("no device decodes {} of {}x{} pixels", name, stream.width,
                                  stream.height)};
}

/// Checks that a hardware decoder's picture is whole and has the stream's size, and removes the
/// rows and columns that fill its last blocks. Removes its colour tags, which drivers guess: those
/// of the stream are used. Returns the fault; empty if there is none.
inline std::string adopt_picture(AVFrame& frame, const AVCodecParameters& stream) {
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

inline constexpr std::chrono::milliseconds kWait{100};

inline constexpr int64_t kMostPixels = int64_t{1} << 28;
/// Consecutive read errors after which the rest of the file is skipped.
inline constexpr int kMostReadErrors = 100;
/// Calls of a hardware decoder without a picture after which it counts as broken. Decoders keep
/// some tens of packets.
inline constexpr int kMostFruitlessCalls = 1000;
/// Time limit of one call. Shorter than that of the player, which would kill this process.
inline constexpr std::chrono::milliseconds kMostCallTime{4000};
inline constexpr int64_t kProbeBytes = 8 << 20;
inline constexpr int64_t kProbeMicroseconds = 5'000'000;

/// Demuxers and decoders that may be used; the other hundreds in FFmpeg are not.
inline constexpr const char* kContainers =
    "matroska,webm,mov,mp4,avi,nut,mpegts,mpeg,ogg,flv,mxf,asf,ivf,yuv4mpegpipe,gif,apng";
/// Those of files that have nothing but sound, in addition.
inline constexpr const char* kSoundContainers = ",wav,w64,flac,mp3,aac,aiff";
inline constexpr const char* kDecoders =
    "ffv1,rawvideo,h264,hevc,vp8,vp9,libdav1d,av1,png,apng,mjpeg,prores,dnxhd,huffyuv,"
    "ffvhuff,utvideo,magicyuv,mpeg4,mpeg2video,mpeg1video,qtrle,v210,v308,v408,v410,r210,"
    "gif,wrapped_avframe";
inline constexpr const char* kSoundDecoders =
    ",aac,mp3float,mp3,mp2float,mp2,opus,libopus,vorbis,libvorbis,flac,alac,ac3,eac3,wavpack,dca,"
    "pcm_u8,pcm_s16le,pcm_s16be,pcm_s24le,pcm_s24be,pcm_s32le,pcm_s32be,pcm_f32le,pcm_f64le,"
    "pcm_alaw,pcm_mulaw,pcm_bluray,pcm_dvd,wmav2";

[[noreturn]] inline void fail(const std::string& name, const std::string& cause,
                              const std::string& hint = {}) {
  throw input_error("{}: {}", name, cause).remedy(hint);
}

inline int refuse_to_open(AVFormatContext*, AVIOContext**, const char*, int, AVDictionary**) {
  return AVERROR(EACCES);
}

inline bool has_pictures(const AVStream& stream) {
  return stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO &&
         (stream.disposition & AV_DISPOSITION_ATTACHED_PIC) == 0;
}

/// Opens the regular file of that name for reading. Throws Error(Input). Call it before confine().
[[nodiscard]] inline int open_clip_file(const std::string& name) {
  const int fd = ::open(name.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (const int error = errno; fd < 0)
    fail(name, std::string("cannot read: ") + std::strerror(error), read_remedy(name, error));
  struct stat status {};
  if (fstat(fd, &status) == 0 && S_ISREG(status.st_mode)) return fd;
  ::close(fd);
  fail(name, "cannot read: not a regular file");
}

/// Makes a decoder of the stream's parameters, which is opened later.
inline AvCodec make_codec(const AVCodec& decoder, const AVStream& stream, const char* allowed) {
  AvCodec codec(avcodec_alloc_context3(&decoder));
  if (!codec || avcodec_parameters_to_context(codec.get(), stream.codecpar) < 0)
    throw Error(ErrorKind::Failed, "video: out of memory");
  codec->max_pixels = kMostPixels;
  codec->codec_whitelist = av_strdup(allowed);
  codec->pkt_timebase = stream.time_base;
  // Decoders of one view, and FFmpeg before 7.1, do not know this option.
  av_opt_set(codec.get(), "view_ids", "-1", AV_OPT_SEARCH_CHILDREN);
  return codec;
}

/// Returns why the stream's codec cannot be decoded; empty if it may be.
[[nodiscard]] inline std::string codec_obstacle(const AVCodecParameters& stream,
                                                const char* supported = kDecoders) {
  const char* const name = avcodec_get_name(stream.codec_id);
  const AVCodec* const decoder = avcodec_find_decoder(stream.codec_id);
  if (decoder == nullptr) return fmt::format("FFmpeg has no decoder for its codec {}", name);
  if (av_match_list(decoder->name, supported, ',') == 0)
    return fmt::format("its codec {} is not supported", name);
  return {};
}

/// Returns true if FFmpeg decodes two views of the stream; before version 7.1 it decodes the first.
/// A decoder of one thread states the views; one of several leaves that to its threads.
[[nodiscard]] inline bool decodes_two_views(const AVStream& stream) {
  if (!has_second_layer(*stream.codecpar)) return false;
  const AVCodec* const decoder = avcodec_find_decoder(AV_CODEC_ID_HEVC);
  const AvCodec codec = decoder == nullptr ? nullptr : make_codec(*decoder, stream, "hevc");
  if (!codec || avcodec_open2(codec.get(), decoder, nullptr) < 0) return false;
  uint8_t* views = nullptr;  // "0,1"
  if (av_opt_get(codec.get(), "view_ids_available", AV_OPT_SEARCH_CHILDREN, &views) < 0)
    return false;
  const bool two = views != nullptr && std::strchr(reinterpret_cast<char*>(views), ',') != nullptr;
  av_free(views);
  return two;
}

/// The number of frames that a file claims to present.
struct ExpectedFrames {
  uint64_t frames = 0;
  /// The number is that of a constant rate until `end`, in units of the stream's time stamps;
  /// otherwise an index or a header states it.
  bool by_duration = false;
  double end = 0.0;
};

/// Returns none if the container claims no number, or only estimates it. The number may grow while
/// a fragmented file is read.
[[nodiscard]] inline std::optional<ExpectedFrames> expected_frames(const AVFormatContext& format,
                                                                   AVStream& stream) {
  const std::string_view container(format.iformat->name);
  const int entries = avformat_index_get_entries_count(&stream);
  int64_t presented = 0;
  for (int i = 0; i < entries; ++i) {
    const AVIndexEntry& entry = *avformat_index_get_entry(&stream, i);
    presented += (entry.flags & AVINDEX_DISCARD_FRAME) == 0 ? 1 : 0;
  }
  // FFmpeg applies edit lists to the index: it lacks the frames that they cut off, and marks those
  // that are decoded but not presented.
  if (container.starts_with("mov") && presented > 0)
    return ExpectedFrames{.frames = static_cast<uint64_t>(presented)};
  // AVI counts the empty frames that fill a gap, but its index lacks them. Those that follow the
  // last frame belong to it and to the delay of reordered frames.
  if (container == "avi" && presented > 0) {
    const int64_t slots = avformat_index_get_entry(&stream, entries - 1)->timestamp + 1;
    const int64_t slots_per_frame = std::max<int64_t>(slots / presented, 1);
    const int64_t delay = slots_per_frame * (stream.codecpar->video_delay + 1) - 1;
    const int64_t after = std::max<int64_t>(stream.nb_frames - slots - delay, 0);
    return ExpectedFrames{.frames = static_cast<uint64_t>(presented + after / slots_per_frame)};
  }
  if (stream.nb_frames > 0)
    return ExpectedFrames{.frames = static_cast<uint64_t>(stream.nb_frames)};
  const AVRational rate = stream.avg_frame_rate;
  if (format.nb_streams != 1 || rate.num <= 0 || rate.den <= 0) return std::nullopt;
  if (!container.starts_with("matroska"))
    return std::nullopt;  // durations of other containers are estimates
  // Matroska's duration ends with the last frame, and begins at time 0, not with the first frame.
  const int64_t start =
      format.start_time == AV_NOPTS_VALUE ? 0 : std::max<int64_t>(format.start_time, 0);
  if (format.duration <= start) return std::nullopt;
  const double seconds = static_cast<double>(format.duration - start) / AV_TIME_BASE;
  return ExpectedFrames{
      .frames = static_cast<uint64_t>(std::llround(seconds * av_q2d(rate))),
      .by_duration = true,
      .end = static_cast<double>(format.duration) / AV_TIME_BASE / av_q2d(stream.time_base)};
}

/// Watchdog acts when a call of a library does not return in time.
///
/// Watchdog calls `expired` on a thread of its own when a Watch lasts longer than `limit`. Signals
/// would not do: FFmpeg repeats an interrupted poll(). The time is counted in short waits of that
/// thread, so that a machine that was suspended, or gives the process no time, does not count.
///
/// Thread safety: one thread makes watches, one at a time.
class Watchdog {
 public:
  /// `expired` should end the process; it is called at most once.
  Watchdog(std::chrono::milliseconds limit, std::function<void()> expired)
      : most_waits_(static_cast<int>(limit / kWait)),
        expired_(std::move(expired)),
        thread_([this](const std::stop_token& stop) { count(stop); }) {}

  /// Watch limits the time of its scope. Lifetime: must not outlive the watchdog.
  class Watch {
   public:
    /// Watches nothing without a watchdog.
    explicit Watch(Watchdog* watchdog) : watchdog_(watchdog) {
      if (watchdog_ != nullptr) watchdog_->watch(true);
    }
    ~Watch() {
      if (watchdog_ != nullptr) watchdog_->watch(false);
    }
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

   private:
    Watchdog* watchdog_;
  };

 private:
  void watch(bool on) {
    const std::lock_guard lock(mutex_);
    watching_ = on;
    waits_ = 0;
  }
  void count(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stopped_.wait_for(lock, stop, kWait, [&] { return stop.stop_requested(); })) {
      if (!watching_ || ++waits_ <= most_waits_) continue;
      lock.unlock();
      expired_();
      return;
    }
  }

  const int most_waits_;
  const std::function<void()> expired_;
  std::mutex mutex_;
  std::condition_variable_any stopped_;
  bool watching_ = false;
  int waits_ = 0;        ///< number of waits in the present watch
  std::jthread thread_;  // last member: the thread uses everything above
};

/// Container is an opened video file. It never opens another file by name, even if the file asks
/// for that.
class Container {
 public:
  /// `name` is for messages. All streams but those with pictures, and with sound if it is wanted,
  /// are discarded, so that they are not parsed. Throws Error(Input) if the file has none.
  Container(const int& fd, std::string name, bool sound = false)
      : name_(std::move(name)), io_(make_io(fd, false)) {
    if (::lseek(fd, 0, SEEK_SET) != 0) fail(name_, "cannot seek to its start");
    AVFormatContext* format = avformat_alloc_context();
    if (format == nullptr) throw Error(ErrorKind::Failed, "video: out of memory");
    format->pb = io_.get();
    format->flags |= AVFMT_FLAG_CUSTOM_IO;
    format->io_open = refuse_to_open;
    format->probesize = kProbeBytes;
    format->max_analyze_duration = kProbeMicroseconds;
    format->format_whitelist = av_asprintf("%s%s", kContainers, sound ? kSoundContainers : "");
    format->codec_whitelist = av_asprintf("%s%s", kDecoders, sound ? kSoundDecoders : "");
    format->protocol_whitelist = av_strdup("none");
    // The call frees `format` on failure.
    const int error = avformat_open_input(&format, nullptr, nullptr, nullptr);
    if (error < 0) {
      refuse_misnamed(fd, name_);
      fail(name_,
           std::string("not a readable video") + (sound ? " or sound: " : ": ") + av_reason(error),
           std::string("supported containers: ") + kContainers);
    }
    format_.reset(format);
    for (unsigned i = 0; i < format->nb_streams; ++i) {
      const AVMediaType type = format->streams[i]->codecpar->codec_type;
      if (type != AVMEDIA_TYPE_VIDEO && !(sound && type == AVMEDIA_TYPE_AUDIO))
        format->streams[i]->discard = AVDISCARD_ALL;
    }
    if (const int found = avformat_find_stream_info(format, nullptr); found < 0)
      fail(name_, "its streams cannot be read: " + av_reason(found));
  }
  [[nodiscard]] AVFormatContext& format() { return *format_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Returns the wanted stream, or the first with pictures. Throws Error(Input) if there is none.
  [[nodiscard]] AVStream& video_stream(std::optional<int> wanted) {
    for (unsigned i = 0; i < format_->nb_streams; ++i) {
      AVStream& stream = *format_->streams[i];
      const bool chosen = wanted ? *wanted == static_cast<int>(i) : has_pictures(stream);
      if (chosen && has_pictures(stream)) return stream;
    }
    if (wanted)
      fail(name_, "stream " + std::to_string(*wanted) + " has no pictures",
           "lenticule-video probe lists the streams");
    fail(name_, "no stream with pictures", "name a file that contains a video");
  }

 private:
  std::string name_;
  AvIo io_;
  AvInput format_;  // last member: uses io_
};

/// SliceErrors collects the packets in which FFmpeg's decoder of FFV1 found a wrong checksum. The
/// decoder replaces their slices by those of the frame before and reports that only in its log.
///
/// Thread safety: any thread.
class SliceErrors {
 public:
  /// Installs the log callback that hears the reports.
  SliceErrors() { av_log_set_callback(hear); }

  /// Listens to this decoder and to its copies in other threads, whose member `opaque` it takes.
  void watch(AVCodecContext& codec) {
    const std::lock_guard lock(mutex_);
    packets_.clear();
    begun_.assign(1, {.errors = this, .number = 0});
    codec.opaque = &begun_.back();
  }
  /// Numbers the packet that is sent to the decoder next.
  void begin(AVCodecContext& codec, AVPacket& packet) {
    const std::lock_guard lock(mutex_);
    begun_.push_back({.errors = this, .number = begun_.back().number + 1});
    if (begun_.size() > kMostAtOnce) begun_.pop_front();
    codec.opaque = &begun_.back();
    number_packet(codec, packet, begun_.back().number);
  }
  /// Returns true if the packet of that number was damaged; forgets it and all before it.
  [[nodiscard]] bool take(int64_t packet) {
    const std::lock_guard lock(mutex_);
    const bool damaged = packets_.contains(packet);
    packets_.erase(packets_.begin(), packets_.upper_bound(packet));
    return damaged;
  }

 private:
  static void hear(void* source, int /*level*/, const char* format, va_list /*arguments*/) {
    if (source == nullptr || *static_cast<const AVClass* const*>(source) != avcodec_get_class())
      return;
    const auto& codec = *static_cast<const AVCodecContext*>(source);
    if (codec.opaque == nullptr || !std::string_view(format).starts_with("slice CRC mismatch"))
      return;
    const Packet packet = *static_cast<const Packet*>(codec.opaque);
    const std::lock_guard lock(packet.errors->mutex_);
    packet.errors->packets_.insert(packet.number);
  }

  /// Packet is what the decoder that works on a packet points to.
  struct Packet {
    SliceErrors* errors = nullptr;
    int64_t number = 0;
  };
  /// More than a decoder works on at once: one for each of its threads.
  static constexpr size_t kMostAtOnce = 1024;

  std::mutex mutex_;
  std::set<int64_t> packets_;  ///< the damaged ones
  std::deque<Packet> begun_;
};

/// The decoder in use, and the reason for a change.
struct DecoderChoice {
  std::string name;  ///< FFmpeg's name
  bool hardware = false;
  std::string reason;  ///< the reason why it is not a hardware decoder; empty for one
};

struct ClipOptions {
  std::optional<int> stream{};              ///< default: the first with pictures
  int threads = 1;                          ///< threads of a software decoder
  std::vector<HardwareDecoder> hardware{};  ///< devices that this process may open
  /// Called for the first hardware decoder, and when a software decoder takes the place of
  /// hardware.
  std::function<void(const DecoderChoice&)> on_choice{};
  /// Called when a hardware decoder fails after its first picture, and on another thread when it
  /// does not answer; must end the process, so that a new one continues in software.
  std::function<void(const DecoderChoice&)> on_failure{};
};

/// ClipReader decodes in hardware where a device can. It changes to software for good if the device
/// reports an error, or gives a picture that the stream cannot have, instead of the first one.
///
/// Thread safety: one thread. Lifetime: the descriptor must outlive the reader.
class ClipReader {
 public:
  enum class Step { Frame, End };

  /// Throws Error(Input) for a file that cannot be decoded.
  ClipReader(const int& fd, std::string name, ClipOptions options)
      : fd_(fd),
        name_(std::move(name)),
        options_(std::move(options)),
        packet_(av_packet_alloc()),
        frame_(av_frame_alloc()),
        second_(av_frame_alloc()) {
    if (!packet_ || !frame_ || !second_) throw Error(ErrorKind::Failed, "video: out of memory");
    open();
  }
  ~ClipReader() { close_decoder(); }

  [[nodiscard]] const AVStream& stream() const { return *stream_; }
  /// Decodes the next picture. Packets that cannot be decoded, and pictures with a wrong checksum,
  /// are skipped and counted. Throws as the constructor.
  [[nodiscard]] Step next() {
    if (!in_hardware_) return next_in_software();
    if (const std::optional<Step> step = next_in_hardware()) return *step;
    const std::string reason = "hardware decoder failed: " + obstacle_;
    if (delivered_)
      options_.on_failure({.name = codec_->codec->name, .hardware = true, .reason = reason});
    const std::optional<int64_t> start = start_;
    give_up_hardware(reason);
    reopen();
    if (start && !seek(*start)) fail(name_, "cannot seek");
    return next_in_software();
  }
  [[nodiscard]] const AVFrame& frame() const { return *frame_; }
  /// Returns the other view of the same moment; null if the stream has one view.
  [[nodiscard]] const AVFrame* second_view() const { return two_views_ ? second_.get() : nullptr; }
  /// Returns true if frame() is for the right eye, and the second view for the left one.
  /// The stream tells in an SEI message which eye a view is for; without it, the container tells
  /// whether the first is the right eye's.
  [[nodiscard]] bool begins_with_right() const {
    const auto tag_of = [](const AvFrame& frame) {
      const AVFrameSideData* const data =
          av_frame_get_side_data(frame.get(), AV_FRAME_DATA_STEREO3D);
      AVStereo3D tag{};
      if (data != nullptr && data->size >= sizeof tag) std::memcpy(&tag, data->data, sizeof tag);
      return tag;
    };
    const AVStereo3D first = tag_of(frame_), second = tag_of(second_);
    if (first.view == AV_STEREO3D_VIEW_LEFT || second.view == AV_STEREO3D_VIEW_RIGHT) return false;
    return first.view == AV_STEREO3D_VIEW_RIGHT || second.view == AV_STEREO3D_VIEW_LEFT ||
           (first.flags & AV_STEREO3D_FLAG_INVERT) != 0;
  }
  [[nodiscard]] std::optional<ExpectedFrames> expected() const {
    return expected_frames(container_->format(), *stream_);
  }
  /// Returns the time stamp of frame(), or AV_NOPTS_VALUE.
  [[nodiscard]] int64_t time() const {
    return untimed_ ? AV_NOPTS_VALUE : frame_->best_effort_timestamp;
  }
  /// Returns true if time may begin anew in the middle of the file.
  [[nodiscard]] bool times_may_jump() const {
    return (container_->format().iformat->flags & AVFMT_TS_DISCONT) != 0;
  }
  [[nodiscard]] uint64_t broken_packets() const { return broken_; }
  /// Returns the number of frames in which the decoder found errors.
  [[nodiscard]] uint64_t faulty_frames() const { return faulty_; }

  /// Seeks to the last key frame at or before `time`; returns false if the file does not support
  /// seeking. Throws as the constructor.
  /// A hardware decoder is opened again, because FFmpeg cannot empty it.
  [[nodiscard]] bool seek(int64_t time) {
    if (time == AV_NOPTS_VALUE) return false;
    AVFormatContext& format = container_->format();
    if (av_seek_frame(&format, stream_->index, time, AVSEEK_FLAG_BACKWARD) < 0) return false;
    if (in_hardware_) {
      close_decoder();
      open_decoder();
    } else {
      avcodec_flush_buffers(codec_.get());
    }
    begin(time);
    return true;
  }
  /// Opens the file again, so that the first frame comes next, even if the container does not
  /// support seeking. Throws as the constructor.
  void reopen() {
    close_decoder();
    stream_ = nullptr;
    container_.reset();
    open();
  }

 private:
  void open() {
    container_ = std::make_unique<Container>(fd_, name_);
    stream_ = &container_->video_stream(options_.stream);
    for (unsigned i = 0; i < container_->format().nb_streams; ++i)
      container_->format().streams[i]->discard =
          static_cast<int>(i) == stream_->index ? AVDISCARD_DEFAULT : AVDISCARD_ALL;
    open_decoder();
    begin(std::nullopt);
  }
  void open_decoder() {
    if (!open_in_hardware()) open_in_software();
  }
  /// Opens the stream's hardware decoder; returns false if it cannot be used.
  [[nodiscard]] bool open_in_hardware() {
    if (options_.hardware.empty()) return false;
    const HardwareChoice choice = choose_hardware(*stream_->codecpar, options_.hardware);
    const AVCodec* const decoder = avcodec_find_decoder_by_name(choice.decoder.c_str());
    if (decoder == nullptr) {
      give_up_hardware(choice.decoder.empty() ? choice.obstacle
                                              : "FFmpeg has no decoder " + choice.decoder);
      return false;
    }
    const DecoderChoice chosen{.name = choice.decoder, .hardware = true, .reason = {}};
    if (!watchdog_)
      watchdog_ = std::make_unique<Watchdog>(kMostCallTime, [fail = options_.on_failure, chosen] {
        fail({.name = chosen.name,
              .hardware = true,
              .reason = fmt::format("hardware decoder {} does not answer", chosen.name)});
      });
    codec_ = make_codec(*decoder, *stream_, choice.decoder.c_str());
    const Watchdog::Watch watch(watchdog_.get());
    if (const int error = avcodec_open2(codec_.get(), decoder, nullptr); error < 0) {
      give_up_hardware(choice.decoder + " cannot be opened: " + av_reason(error));
      return false;
    }
    if (!std::exchange(in_hardware_, true)) options_.on_choice(chosen);
    return true;
  }
  void open_in_software() {
    watchdog_.reset();
    const AVCodecID id = stream_->codecpar->codec_id;
    if (const std::string obstacle = codec_obstacle(*stream_->codecpar); !obstacle.empty())
      fail(name_, obstacle, "convert it, for example to FFV1 or H.264");
    const AVCodec* const decoder = avcodec_find_decoder(id);
    codec_ = make_codec(*decoder, *stream_, kDecoders);
    codec_->thread_count = options_.threads;
    slice_errors_.watch(*codec_);
    codec_->err_recognition = AV_EF_CRCCHECK;
    // A damaged frame of an intra-only codec is skipped. Frames of other codecs depend on each
    // other, so the decoder conceals the error.
    const AVCodecDescriptor* const about = avcodec_descriptor_get(id);
    if (about != nullptr && (about->props & AV_CODEC_PROP_INTRA_ONLY) != 0)
      codec_->err_recognition |= AV_EF_EXPLODE;
    if (const int error = avcodec_open2(codec_.get(), decoder, nullptr); error < 0)
      fail(name_, fmt::format("{} cannot be decoded: {}", avcodec_get_name(id), av_reason(error)));
    two_views_ = decodes_two_views(*stream_);
  }
  /// Gives a hardware decoder its buffers back and closes the device.
  void close_decoder() {
    const Watchdog::Watch watch(watchdog_.get());
    av_frame_unref(frame_.get());
    av_frame_unref(second_.get());
    codec_.reset();
  }
  /// Forgets the state of what was decoded so far.
  void begin(std::optional<int64_t> time) {
    av_packet_unref(packet_.get());
    packet_waits_ = false;
    untimed_ = false;
    awaits_key_ = false;
    awaits_second_ = false;
    draining_ = false;
    read_errors_ = 0;
    start_ = time;
    delivered_ = false;
    hidden_.clear();
  }
  [[nodiscard]] Step next_in_software() {
    while (true) {
      const int error = receive();
      if (error == 0 && is_spoilt()) {
        ++broken_;
        continue;
      }
      if (error == 0) {
        const bool faulty =
            frame_->decode_error_flags != 0 || (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0;
        faulty_ += faulty ? 1 : 0;
        if (two_views_ && !completes_pair()) continue;
        return Step::Frame;
      }
      if (error == AVERROR_EOF) return Step::End;
      if (error != AVERROR(EAGAIN)) {
        ++broken_;
        if (draining_ && ++read_errors_ > kMostReadErrors) return Step::End;
        continue;
      }
      if (draining_ || !feed()) return Step::End;
    }
  }
  /// Returns none if the device fails.
  [[nodiscard]] std::optional<Step> next_in_hardware() {
    for (int calls = 0; calls < kMostFruitlessCalls; ++calls) {
      const int error = receive();
      if (error == 0) {
        obstacle_ = adopt_picture(*frame_, *stream_->codecpar);
        if (!obstacle_.empty()) return std::nullopt;
        delivered_ = true;
        if (hidden_.erase(time()) > 0) continue;
        return Step::Frame;
      }
      if (error == AVERROR_EOF && draining_ && delivered_) return Step::End;
      obstacle_ = error == AVERROR_EOF ? "it ends before the file" : av_reason(error);
      if (error != AVERROR(EAGAIN)) return std::nullopt;
      obstacle_ = "it refuses a packet";
      if (!draining_ && !feed()) return std::nullopt;
    }
    obstacle_ = "it gives no picture";
    return std::nullopt;
  }
  /// Decodes in software from now on.
  void give_up_hardware(const std::string& reason) {
    close_decoder();
    options_.hardware.clear();
    in_hardware_ = false;
    options_.on_choice({.name = avcodec_get_name(stream_->codecpar->codec_id),
                        .hardware = false,
                        .reason = reason});
  }
  /// Reads the stream's next packet; returns false at the end.
  [[nodiscard]] bool read_packet() {
    while (true) {
      const int error = av_read_frame(&container_->format(), packet_.get());
      if (error < 0 && error != AVERROR_EOF && ++read_errors_ <= kMostReadErrors) {
        ++broken_;
        continue;
      }
      read_errors_ = 0;
      if (error < 0) return false;
      if (packet_->stream_index == stream_->index) return true;
      av_packet_unref(packet_.get());
    }
  }
  /// Sends the next packet, or the end of the stream, to the decoder; returns false if it accepts
  /// neither.
  [[nodiscard]] bool feed() {
    if (!packet_waits_ && !read_packet()) {
      draining_ = true;
      return send(nullptr) == 0;
    }
    if (!in_hardware_) slice_errors_.begin(*codec_, *packet_);
    const int sent = send(packet_.get());
    packet_waits_ = in_hardware_ && sent == AVERROR(EAGAIN);
    if (packet_waits_) return true;
    av_packet_unref(packet_.get());
    if (sent < 0 && in_hardware_) return false;
    if (sent < 0) ++broken_;
    return true;
  }
  [[nodiscard]] int send(const AVPacket* packet) {
    const Watchdog::Watch watch(watchdog_.get());
    if (in_hardware_ && packet != nullptr) {
      untimed_ = untimed_ || packet->pts == AV_NOPTS_VALUE;
      if ((packet->flags & AV_PKT_FLAG_DISCARD) != 0) hidden_.insert(packet->pts);
    }
    return avcodec_send_packet(codec_.get(), packet);
  }
  [[nodiscard]] int receive() {
    const Watchdog::Watch watch(watchdog_.get());
    return avcodec_receive_frame(codec_.get(), frame_.get());
  }
  /// Returns true if the frame has a damaged slice, or depends on a frame that had one.
  [[nodiscard]] bool is_spoilt() {
    const bool damaged = slice_errors_.take(packet_number(*frame_));
    awaits_key_ = damaged || (awaits_key_ && !is_key_frame(*frame_));
    return awaits_key_;
  }
  /// Returns true if frame_ and second_ are the views of one moment. A view whose other one is
  /// missing is left out. The decoder gives the views of a moment one after the other.
  [[nodiscard]] bool completes_pair() {
    std::swap(frame_, second_);
    const bool pair = awaits_second_ && frame_->pts == second_->pts &&
                      view_number(*frame_) != view_number(*second_);
    broken_ += awaits_second_ && !pair ? 1 : 0;
    awaits_second_ = !pair;
    return pair;
  }

  const int& fd_;
  std::string name_;
  ClipOptions options_;
  std::unique_ptr<Watchdog> watchdog_;  ///< present while a hardware decoder is in use
  std::unique_ptr<Container> container_;
  AVStream* stream_ = nullptr;
  SliceErrors slice_errors_;  // must precede codec_, which uses it
  AvCodec codec_;
  AvPacket packet_;
  AvFrame frame_;
  AvFrame second_;
  bool two_views_ = false;
  bool awaits_second_ = false;  ///< second_ is a view whose other one has not been decoded yet
  bool in_hardware_ = false;
  bool draining_ = false;
  bool awaits_key_ = false;    ///< an FFV1 frame was damaged, and later ones may depend on it
  bool packet_waits_ = false;  ///< the device had no room for packet_
  bool untimed_ = false;       ///< the device replaces missing time stamps by zero
  std::string obstacle_;       ///< fault of the device
  uint64_t broken_ = 0;
  uint64_t faulty_ = 0;
  int read_errors_ = 0;

  std::optional<int64_t> start_;  ///< time of the last seek() since open()
  bool delivered_ = false;        ///< a hardware decoder gave a picture since then
  /// Times of frames that an edit list hides; a device does not know of that.
  std::set<int64_t> hidden_;
};

}  // namespace lenticule::video
