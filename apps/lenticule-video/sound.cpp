// SPDX-License-Identifier: Apache-2.0
// lenticule-video sound decodes a sound stream into a player's SoundRing, at the player's rate.
//
// Each sample has one place, whatever the decoder and the file do. Time 0 of a file is its first
// picture, or its first sample if it has no pictures. Round k of a film of N frames begins at
// sample floor(k N rate / fps), so that rounds join without a sample lost or added for ever. What
// the file does not give at a place is silence: before its first sample, after its last, and where
// packets are damaged. A round begins with a newly opened file, so that all rounds are the same.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "apps/lenticule-video/clip_reader.h"
#include "apps/lenticule-video/confinement.h"
#include "apps/lenticule-video/subcommands.h"
#include "base/error.h"
#include "base/unique_fd.h"
#include "frames/sound/sound_ring.h"

namespace lenticule::video {
namespace {

constexpr uint64_t kMemoryBytes = uint64_t{1} << 30;
constexpr int64_t kNoEnd = std::numeric_limits<int64_t>::max() / 4;
constexpr double kWarmUpSeconds = 1.0;  ///< is decoded and dropped after a seek
/// Time stamps that differ less from the number of samples are not followed: containers round them.
constexpr double kUsualDeviation = 0.04, kDeviationAfterDamage = 0.003;
constexpr int kMostFileChannels = 64, kMostFileRate = 768'000;

/// SoundFeed decodes the file round after round, and writes each sample at its place.
class SoundFeed {
 public:
  SoundFeed(const int& fd, const SoundRequest& request, frames::SoundRing& ring)
      : fd_(fd),
        request_(request),
        channels_(static_cast<size_t>(request.channels)),
        ring_(ring),
        packet_(av_packet_alloc()),
        frame_(av_frame_alloc()) {
    if (!packet_ || !frame_) throw Error(ErrorKind::Failed, "sound: out of memory");
  }
  /// Never returns: after the last round comes silence, until the player ends this process.
  [[noreturn]] void run() {
    uint64_t round = request_.frames > 0 ? request_.from / request_.frames : 0;
    for (int64_t first = place_of(request_.from) - begin_of(round);; first = 0, ++round) {
      const int64_t length = begin_of(round + 1) - begin_of(round);
      if (!play(first, length > 0 ? length : kNoEnd) || !request_.loop) break;
    }
    write_silence(kNoEnd);
    std::abort();  // not reached
  }

 private:
  /// Returns the sample at which a frame begins.
  [[nodiscard]] int64_t place_of(uint64_t frame) const {
    if (!request_.fps) return 0;
    return av_rescale_rnd(static_cast<int64_t>(frame), request_.rate * request_.fps->denominator,
                          request_.fps->numerator, AV_ROUND_DOWN);
  }
  [[nodiscard]] int64_t begin_of(uint64_t round) const { return place_of(round * request_.frames); }

  /// Plays the samples [first, length) of a round. Returns false if its length is not known.
  [[nodiscard]] bool play(int64_t first, int64_t length) {
    const int64_t begin = place_of(request_.begin);
    at_ = begin + first;
    end_ = length == kNoEnd ? kNoEnd : begin + length;
    open();
    if (at_ > 0) seek();
    while (at_ < end_ && decode()) continue;
    // A film of unknown length ends with its pictures; a still picture's sound repeats by itself.
    if (end_ == kNoEnd && request_.fps) {
      if (!pictures_end_s_) return false;
      end_ = static_cast<int64_t>(std::llround(*pictures_end_s_ * request_.rate));
    }
    if (end_ != kNoEnd) write_silence(end_ - at_);
    return at_ > begin;
  }
  void open() {
    pictures_ = stream_ = nullptr;
    codec_.reset();
    swr_.reset();
    origin_.reset();
    container_.emplace(fd_, request_.file, Wanted::PicturesAndSound);
    AVFormatContext& format = container_->format();
    for (unsigned i = 0; i < format.nb_streams; ++i) {
      AVStream& one = *format.streams[i];
      const bool sound = one.codecpar->codec_type == AVMEDIA_TYPE_AUDIO;
      const bool wanted = sound && request_.stream.value_or(one.index) == one.index;
      if (wanted && stream_ == nullptr)
        stream_ = &one;
      else if (has_pictures(one) && pictures_ == nullptr)
        pictures_ = &one;
      if (&one != stream_ && (&one != pictures_ || request_.frames > 0))
        one.discard = AVDISCARD_ALL;
    }
    if (stream_ == nullptr) fail(request_.file, "no such sound", "lenticule-video probe lists it");
    if (pictures_ != nullptr && pictures_->start_time != AV_NOPTS_VALUE)
      origin_ = seconds(pictures_->start_time, *pictures_);
    const AVCodecParameters& about = *stream_->codecpar;
    if (const std::string why = codec_obstacle(about, kSoundDecoders); !why.empty())
      fail(request_.file, why, "convert its sound, for example to FLAC or Opus");
    const AVCodec* const decoder = avcodec_find_decoder(about.codec_id);
    codec_ = make_codec(*decoder, *stream_, kSoundDecoders);
    if (const int error = avcodec_open2(codec_.get(), decoder, nullptr); error < 0)
      fail(request_.file, "its sound cannot be decoded: " + av_reason(error));
  }
  /// Files without an index are decoded from the start.
  void seek() {
    const double to = static_cast<double>(at_) / request_.rate - kWarmUpSeconds;
    if (!origin_ && stream_->start_time != AV_NOPTS_VALUE)
      origin_ = seconds(stream_->start_time, *stream_);
    const int64_t time = std::llround((origin_.value_or(0.0) + to) / av_q2d(stream_->time_base));
    if (to > 0.0 &&
        av_seek_frame(&container_->format(), stream_->index, time, AVSEEK_FLAG_BACKWARD) >= 0)
      avcodec_flush_buffers(codec_.get());
  }
  static double seconds(int64_t time, const AVStream& stream) {
    return static_cast<double>(time) * av_q2d(stream.time_base);
  }

  /// Decodes the next frame; returns false at the end.
  [[nodiscard]] bool decode() {
    const int error = avcodec_receive_frame(codec_.get(), frame_.get());
    if (error == 0)
      convert();
    else if (error == AVERROR(EAGAIN))
      send_packet();
    else if (error != AVERROR_EOF)
      note_damage();
    if (error == AVERROR_EOF) end_run();
    return error != AVERROR_EOF;
  }
  void send_packet() {
    av_packet_unref(packet_.get());
    const int error = av_read_frame(&container_->format(), packet_.get());
    if (error < 0 && error != AVERROR_EOF && ++read_errors_ <= kMostReadErrors)
      return note_damage();
    if (error < 0) return (void)avcodec_send_packet(codec_.get(), nullptr);
    const AVPacket& packet = *packet_;
    if (packet.stream_index != stream_->index && origin_ && packet.pts != AV_NOPTS_VALUE)
      pictures_end_s_ = std::max(pictures_end_s_.value_or(0.0),
                                 seconds(packet.pts + packet.duration, *pictures_) - *origin_);
    if (packet.stream_index == stream_->index && avcodec_send_packet(codec_.get(), &packet) < 0)
      note_damage();
  }
  void note_damage() {
    after_damage_ = true;
    ++damaged_;
    const auto now = std::chrono::steady_clock::now();
    if (now - reported_at_ < std::chrono::milliseconds(500)) return;
    reported_at_ = now;
    report_event({{"event", "broken"}, {"count", damaged_}});
  }

  /// Converts a frame. A time stamp that does not continue the samples before begins a new run.
  void convert() {
    const AVFrame& frame = *frame_;
    const int channels = frame.ch_layout.nb_channels;
    if (frame.nb_samples <= 0 || frame.sample_rate < 1000 || frame.sample_rate > kMostFileRate ||
        channels < 1 || channels > kMostFileChannels)
      return note_damage();
    if (frame.format != format_ || frame.sample_rate != rate_ || channels != file_channels_)
      end_run();
    if (const int64_t pts = frame.best_effort_timestamp; pts != AV_NOPTS_VALUE) {
      if (!origin_) origin_ = seconds(pts, *stream_);
      const int64_t stated = std::llround((seconds(pts, *stream_) - *origin_) * request_.rate);
      const int64_t continued = next_ + (swr_ ? swr_get_delay(swr_.get(), request_.rate) : 0);
      const double most = after_damage_ ? kDeviationAfterDamage : kUsualDeviation;
      if (std::abs(static_cast<double>(stated - continued)) > most * request_.rate) end_run();
      if (!swr_) next_ = stated;
    }
    after_damage_ = false;
    if (!swr_) begin_run();
    push(frame.extended_data, frame.nb_samples);
  }
  void begin_run() {
    AVChannelLayout to{}, from = frame_->ch_layout;  // of up to 64 channels: owns nothing
    av_channel_layout_default(&to, request_.channels);
    if (from.order == AV_CHANNEL_ORDER_UNSPEC) av_channel_layout_default(&from, from.nb_channels);
    format_ = frame_->format;
    rate_ = frame_->sample_rate;
    file_channels_ = frame_->ch_layout.nb_channels;
    SwrContext* made = nullptr;
    const int error = swr_alloc_set_opts2(&made, &to, AV_SAMPLE_FMT_FLT, request_.rate, &from,
                                          static_cast<AVSampleFormat>(format_), rate_, 0, nullptr);
    swr_.reset(made);
    if (error < 0 || swr_init(made) < 0)
      fail(request_.file, "its sound cannot be converted", "convert it, for example to FLAC");
  }
  /// Ends a run with what the resampler holds of it.
  void end_run() {
    if (swr_) push(nullptr, 0);
    swr_.reset();
  }
  void push(uint8_t* const* data, int count) {
    const int room = std::max(swr_get_out_samples(swr_.get(), count), 0);
    samples_.resize(static_cast<size_t>(room) * channels_);
    auto* to = reinterpret_cast<uint8_t*>(samples_.data());
    const int64_t got =
        swr_convert(swr_.get(), &to, room, const_cast<const uint8_t**>(data), count);
    if (got <= 0) return;
    write_silence(std::min(next_, end_) - at_);
    const int64_t from = std::clamp<int64_t>(at_ - next_, 0, got);
    const int64_t until = std::clamp<int64_t>(end_ - next_, from, got);
    write(std::span(samples_).subspan(static_cast<size_t>(from) * channels_,
                                      static_cast<size_t>(until - from) * channels_));
    next_ += got;
  }

  void write_silence(int64_t count) {
    const std::vector<float> zeros(1024 * channels_, 0.0F);
    for (; count > 0; count -= 1024)
      write(
          std::span(zeros).first(static_cast<size_t>(std::min<int64_t>(count, 1024)) * channels_));
  }
  /// Waits while the ring is full. The kernel ends this process with the player.
  void write(std::span<const float> samples) {
    while (!samples.empty()) {
      const size_t room = std::min<uint64_t>(ring_.room() * channels_, samples.size());
      if (room == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
      ring_.write(samples.first(room));
      samples = samples.subspan(room);
      at_ += static_cast<int64_t>(room / channels_);
    }
  }

  const int& fd_;
  const SoundRequest& request_;
  const size_t channels_;
  frames::SoundRing& ring_;
  AvPacket packet_;
  AvFrame frame_;
  std::optional<Container> container_;
  AVStream* stream_ = nullptr;
  AVStream* pictures_ = nullptr;
  AvCodec codec_;
  SwResampler swr_;
  int format_ = 0, rate_ = 0, file_channels_ = 0;  ///< of the run
  std::vector<float> samples_;
  int64_t at_ = 0;                ///< place in the file of the next sample of the ring
  int64_t end_ = 0;               ///< place at which the round ends
  int64_t next_ = 0;              ///< place of the next sample of the run
  std::optional<double> origin_;  ///< time 0 of the file, seconds
  std::optional<double> pictures_end_s_;
  uint64_t damaged_ = 0;
  std::chrono::steady_clock::time_point reported_at_;
  bool after_damage_ = false;
  int read_errors_ = 0;
};

}  // namespace

int run_sound(const SoundRequest& request) {
  if (request.parent > 0 && !die_with(request.parent)) return 1;
  volunteer_for_oom();
  const UniqueFd input(open_clip_file(request.file));
  frames::SoundRing ring(UniqueFd(request.ring_fd), request.channels);
  confine(kMemoryBytes, request.parent);
  const int fd = input.get();
  SoundFeed(fd, request, ring).run();
}

}  // namespace lenticule::video
