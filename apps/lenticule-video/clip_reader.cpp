// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/clip_reader.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <iterator>
#include <string_view>
#include <utility>

#include "apps/lenticule-video/descriptor_io.h"
#include "apps/lenticule-video/hardware_pictures.h"
#include "base/error.h"
#include "base/file.h"

namespace lenticule::video {
namespace {

constexpr int64_t kMostPixels = int64_t{1} << 28;
/// Consecutive read errors after which the rest of the file is skipped.
constexpr int kMostReadErrors = 100;
/// Calls of a hardware decoder without a picture after which it counts as broken. Decoders keep
/// some tens of packets.
constexpr int kMostFruitlessCalls = 1000;
/// Key frames that are remembered until the device gives them.
constexpr size_t kMostKeyTimes = 1000;
/// Time limit of one call. Shorter than that of the player, which would kill this process.
constexpr std::chrono::milliseconds kMostCallTime{4000};
constexpr int64_t kProbeBytes = 8 << 20;
constexpr int64_t kProbeMicroseconds = 5'000'000;

[[noreturn]] void fail(const std::string& name, const std::string& cause,
                       const std::string& hint = {}) {
  throw Error(ErrorKind::Input, name + ": " + cause, hint);
}

int refuse_to_open(AVFormatContext*, AVIOContext**, const char*, int, AVDictionary**) {
  return AVERROR(EACCES);
}

/// Discards all other streams, so that they are not parsed.
void discard_all_but_video(AVFormatContext& format) {
  for (unsigned i = 0; i < format.nb_streams; ++i)
    if (format.streams[i]->codecpar->codec_type != AVMEDIA_TYPE_VIDEO)
      format.streams[i]->discard = AVDISCARD_ALL;
}

bool has_pictures(const AVStream& stream) {
  return stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO &&
         (stream.disposition & AV_DISPOSITION_ATTACHED_PIC) == 0;
}

}  // namespace

const char* allowed_containers() {
  return "matroska,webm,mov,mp4,avi,nut,mpegts,mpeg,ogg,flv,mxf,asf,ivf,yuv4mpegpipe,gif,apng";
}

const char* allowed_codecs() {
  return "ffv1,rawvideo,h264,hevc,vp8,vp9,libdav1d,av1,png,apng,mjpeg,prores,dnxhd,huffyuv,"
         "ffvhuff,utvideo,magicyuv,mpeg4,mpeg2video,mpeg1video,qtrle,v210,v308,v408,v410,r210,"
         "gif,wrapped_avframe";
}

int open_clip_file(const std::string& name) {
  const int fd = ::open(name.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (const int error = errno; fd < 0)
    fail(name, std::string("cannot read: ") + std::strerror(error), read_remedy(name, error));
  struct stat status {};
  if (fstat(fd, &status) == 0 && S_ISREG(status.st_mode)) return fd;
  ::close(fd);
  fail(name, "cannot read: not a regular file");
}

Container::Container(const int& fd, std::string name)
    : name_(std::move(name)), io_(read_descriptor(fd)) {
  if (::lseek(fd, 0, SEEK_SET) != 0) fail(name_, "cannot seek to its start");
  AVFormatContext* format = avformat_alloc_context();
  if (format == nullptr) throw Error(ErrorKind::Failed, "video: out of memory");
  format->pb = io_.get();
  format->flags |= AVFMT_FLAG_CUSTOM_IO;
  format->io_open = refuse_to_open;
  format->probesize = kProbeBytes;
  format->max_analyze_duration = kProbeMicroseconds;
  format->format_whitelist = av_strdup(allowed_containers());
  format->codec_whitelist = av_strdup(allowed_codecs());
  format->protocol_whitelist = av_strdup("none");
  // The call frees `format` on failure.
  const int error = avformat_open_input(&format, nullptr, nullptr, nullptr);
  if (error < 0)
    fail(name_, "not a readable video: " + av_reason(error),
         std::string("supported containers: ") + allowed_containers());
  format_.reset(format);
  discard_all_but_video(*format);
  if (const int found = avformat_find_stream_info(format, nullptr); found < 0)
    fail(name_, "its streams cannot be read: " + av_reason(found));
}

AVStream& Container::video_stream(std::optional<int> wanted) {
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

// --- expected frames -----------------------------------------------------------------------------

std::optional<ExpectedFrames> expected_frames(const AVFormatContext& format, AVStream& stream) {
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

// --- slice checksums ---------------------------------------------------------------------------

SliceErrors::SliceErrors() {
  av_log_set_callback(hear);
}

void SliceErrors::watch(AVCodecContext& codec) {
  const std::lock_guard lock(mutex_);
  packets_.clear();
  codec.opaque = this;
  codec.reordered_opaque = 0;
}

bool SliceErrors::take(int64_t packet) {
  const std::lock_guard lock(mutex_);
  const bool damaged = packets_.contains(packet);
  packets_.erase(packets_.begin(), packets_.upper_bound(packet));
  return damaged;
}

void SliceErrors::hear(void* source, int /*level*/, const char* format, va_list /*arguments*/) {
  if (source == nullptr || *static_cast<const AVClass* const*>(source) != avcodec_get_class())
    return;
  const auto& codec = *static_cast<const AVCodecContext*>(source);
  if (codec.opaque == nullptr || !std::string_view(format).starts_with("slice CRC mismatch"))
    return;
  auto& errors = *static_cast<SliceErrors*>(codec.opaque);
  const std::lock_guard lock(errors.mutex_);
  errors.packets_.insert(codec.reordered_opaque);
}

// --- frames --------------------------------------------------------------------------------------

ClipReader::ClipReader(const int& fd, std::string name, ClipOptions options)
    : fd_(fd),
      name_(std::move(name)),
      options_(std::move(options)),
      packet_(av_packet_alloc()),
      frame_(av_frame_alloc()) {
  if (!packet_ || !frame_) throw Error(ErrorKind::Failed, "video: out of memory");
  open();
}

ClipReader::~ClipReader() {
  close_decoder();
}

void ClipReader::open() {
  container_ = std::make_unique<Container>(fd_, name_);
  stream_ = &container_->video_stream(options_.stream);
  for (unsigned i = 0; i < container_->format().nb_streams; ++i)
    container_->format().streams[i]->discard =
        static_cast<int>(i) == stream_->index ? AVDISCARD_DEFAULT : AVDISCARD_ALL;
  open_decoder();
  begin(std::nullopt);
}

/// Forgets the state of what was decoded so far.
void ClipReader::begin(std::optional<int64_t> time) {
  av_packet_unref(packet_.get());
  packet_waits_ = false;
  untimed_ = false;
  awaits_key_ = false;
  draining_ = false;
  read_errors_ = 0;
  start_ = time;
  delivered_ = 0;
  key_times_.clear();
  key_.reset();
  broken_before_ = broken_;
}

void ClipReader::open_decoder() {
  if (!open_in_hardware()) open_in_software();
}

/// Gives a hardware decoder its buffers back and closes the device.
void ClipReader::close_decoder() {
  const Watchdog::Watch watch(watchdog_.get());
  av_frame_unref(frame_.get());
  codec_.reset();
}

/// Makes a decoder of the stream's parameters, which is opened later.
void ClipReader::make_codec(const AVCodec& decoder, const char* allowed) {
  codec_.reset(avcodec_alloc_context3(&decoder));
  if (!codec_) throw Error(ErrorKind::Failed, "video: out of memory");
  if (const int error = avcodec_parameters_to_context(codec_.get(), stream_->codecpar); error < 0)
    fail(name_, "damaged stream header: " + av_reason(error));
  codec_->max_pixels = kMostPixels;
  codec_->codec_whitelist = av_strdup(allowed);
  codec_->pkt_timebase = stream_->time_base;
}

void ClipReader::start_watchdog(const DecoderChoice& choice) {
  if (watchdog_) return;
  watchdog_ = std::make_unique<Watchdog>(kMostCallTime,
                                         [hang = options_.on_hang, choice] { hang(choice); });
}

/// Opens the stream's hardware decoder; returns false if it cannot be used.
bool ClipReader::open_in_hardware() {
  if (options_.hardware.empty()) return false;
  const HardwareChoice choice = choose_hardware(*stream_->codecpar, options_.hardware);
  const AVCodec* const decoder = avcodec_find_decoder_by_name(choice.decoder.c_str());
  if (decoder == nullptr) {
    give_up_hardware(choice.decoder.empty() ? choice.obstacle
                                            : "FFmpeg has no decoder " + choice.decoder);
    return false;
  }
  const DecoderChoice chosen{.name = choice.decoder, .hardware = true, .reason = {}};
  start_watchdog(chosen);
  make_codec(*decoder, choice.decoder.c_str());
  const Watchdog::Watch watch(watchdog_.get());
  if (const int error = avcodec_open2(codec_.get(), decoder, nullptr); error < 0) {
    give_up_hardware(choice.decoder + " cannot be opened: " + av_reason(error));
    return false;
  }
  if (!std::exchange(in_hardware_, true)) options_.on_choice(chosen);
  return true;
}

/// Decodes in software from now on.
void ClipReader::give_up_hardware(const std::string& reason) {
  close_decoder();
  options_.hardware.clear();
  in_hardware_ = false;
  options_.on_choice(
      {.name = avcodec_get_name(stream_->codecpar->codec_id), .hardware = false, .reason = reason});
}

void ClipReader::open_in_software() {
  watchdog_.reset();
  const AVCodecID id = stream_->codecpar->codec_id;
  const AVCodec* const decoder = avcodec_find_decoder(id);
  const char* const codec_name = avcodec_get_name(id);
  if (decoder == nullptr) fail(name_, std::string("no decoder for ") + codec_name);
  make_codec(*decoder, allowed_codecs());
  codec_->thread_count = options_.threads;
  slice_errors_.watch(*codec_);
  codec_->err_recognition = AV_EF_CRCCHECK;
  // A damaged frame of an intra-only codec is skipped. Frames of other codecs depend on each other,
  // so the decoder conceals the error.
  const AVCodecDescriptor* const about = avcodec_descriptor_get(id);
  if (about != nullptr && (about->props & AV_CODEC_PROP_INTRA_ONLY) != 0)
    codec_->err_recognition |= AV_EF_EXPLODE;
  if (const int error = avcodec_open2(codec_.get(), decoder, nullptr); error < 0)
    fail(name_, std::string(codec_name) + " cannot be decoded: " + av_reason(error));
}

ClipReader::Step ClipReader::next() {
  if (!in_hardware_) return next_in_software();
  const std::optional<Step> step = next_in_hardware();
  return step ? *step : continue_in_software();
}

/// Returns none if the device fails.
std::optional<ClipReader::Step> ClipReader::next_in_hardware() {
  for (int calls = 0; calls < kMostFruitlessCalls; ++calls) {
    const int error = receive();
    if (error == 0) {
      obstacle_ = adopt_picture(*frame_, *stream_->codecpar);
      if (!obstacle_.empty()) return std::nullopt;
      ++delivered_;
      note_key_frame();
      return Step::Frame;
    }
    if (error == AVERROR_EOF && draining_ && delivered_ > 0) return Step::End;
    obstacle_ = error == AVERROR_EOF ? "it ends before the file" : av_reason(error);
    if (error != AVERROR(EAGAIN)) return std::nullopt;
    obstacle_ = "it refuses a packet";
    if (!draining_ && !feed()) return std::nullopt;
  }
  obstacle_ = "it gives no picture";
  return std::nullopt;
}

/// Remembers the picture if it is a key frame, from which software could continue.
void ClipReader::note_key_frame() {
  const auto found = key_times_.find(time());
  if (found == key_times_.end()) return;
  key_ = {.time = *found, .delivered = delivered_};
  key_times_.erase(key_times_.begin(), std::next(found));
}

/// Decodes up to the key frame; returns false if the file does not lead to it.
bool ClipReader::find(const KeyFrame& key) {
  if (!seek(key.time)) return false;
  while (next_in_software() == Step::Frame)
    if (time() >= key.time) return time() == key.time;
  return false;
}

/// Replaces the hardware decoder and decodes the picture after the last one that it gave.
ClipReader::Step ClipReader::continue_in_software() {
  const uint64_t delivered = delivered_;
  const std::optional<int64_t> start = start_;
  const std::optional<KeyFrame> key = key_;
  give_up_hardware(std::string("hardware decoder failed: ") + obstacle_);
  broken_ = broken_before_;
  reopen();
  uint64_t known = 0;
  if (key && find(*key)) {
    known = key->delivered;
  } else {
    reopen();
    if (start && !seek(*start)) fail(name_, "cannot seek");
  }
  for (uint64_t i = known; i < delivered; ++i)
    if (next_in_software() == Step::End) return Step::End;
  return next_in_software();
}

ClipReader::Step ClipReader::next_in_software() {
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

/// Returns true if the frame has a damaged slice, or depends on a frame that had one.
bool ClipReader::is_spoilt() {
  const bool damaged = slice_errors_.take(frame_->reordered_opaque);
  awaits_key_ = damaged || (awaits_key_ && frame_->key_frame == 0);
  return awaits_key_;
}

int ClipReader::receive() {
  const Watchdog::Watch watch(watchdog_.get());
  return avcodec_receive_frame(codec_.get(), frame_.get());
}

int ClipReader::send(const AVPacket* packet) {
  const Watchdog::Watch watch(watchdog_.get());
  if (in_hardware_ && packet != nullptr) {
    untimed_ = untimed_ || packet->pts == AV_NOPTS_VALUE;
    if ((packet->flags & AV_PKT_FLAG_KEY) != 0) key_times_.insert(packet->pts);
    if (key_times_.size() > kMostKeyTimes) key_times_.erase(key_times_.begin());
  }
  return avcodec_send_packet(codec_.get(), packet);
}

/// Reads the stream's next packet; returns false at the end.
bool ClipReader::read_packet() {
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
bool ClipReader::feed() {
  if (!packet_waits_ && !read_packet()) {
    draining_ = true;
    return send(nullptr) == 0;
  }
  ++codec_->reordered_opaque;
  const int sent = send(packet_.get());
  packet_waits_ = in_hardware_ && sent == AVERROR(EAGAIN);
  if (packet_waits_) return true;
  av_packet_unref(packet_.get());
  if (sent < 0 && in_hardware_) return false;
  if (sent < 0) ++broken_;
  return true;
}

/// A hardware decoder is opened again, because FFmpeg cannot empty it.
bool ClipReader::seek(int64_t time) {
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

void ClipReader::reopen() {
  close_decoder();
  stream_ = nullptr;
  container_.reset();
  open();
}

}  // namespace lenticule::video
