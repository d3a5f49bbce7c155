// SPDX-License-Identifier: Apache-2.0
// lenticule-video sound decodes a sound stream into a player's SoundRing.
//
// Each sample has one place, also after damage and in later rounds. Time 0 of a file is its first
// picture, or its first sample if it has no pictures. Round k of a film of N frames begins at
// sample floor(k N rate / fps), so that rounds join without a sample lost or added for ever. What
// the file does not give at a place is silence: before its first sample, after its last, and where
// packets are damaged. A round begins with a newly opened file, so that all rounds are the same.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "apps/lenticule-video/clip_reader.h"
#include "apps/lenticule-video/confinement.h"
#include "apps/lenticule-video/subcommands.h"
#include "base/error.h"
#include "base/unique_fd.h"
#include "frames/sound/sound_ring.h"

namespace lenticule::video {
namespace {

using Frame = frames::SoundRing::Frame;

constexpr uint64_t kMemoryBytes = uint64_t{1} << 30;
constexpr int kRate = frames::SoundRing::kRate, kChannels = frames::SoundRing::kChannels;
constexpr int64_t kMostHeld = int64_t{30} * kRate;
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
        ring_(ring),
        packet_(av_packet_alloc()),
        frame_(av_frame_alloc()) {
    if (!packet_ || !frame_) throw Error(ErrorKind::Failed, "sound: out of memory");
  }
  /// Never returns: after the last round comes silence, until the player ends this process.
  [[noreturn]] void run() {
    int64_t first = place_of(request_.from);
    for (uint64_t round = 0;; first = 0, ++round) {
      const int64_t length =
          place_of((round + 1) * request_.frames) - place_of(round * request_.frames);
      if (!play(first, length > 0 ? length : kNoEnd)) break;
    }
    while (true) write_silence(kRate);
  }

 private:
  /// Returns the sample at which a frame begins.
  [[nodiscard]] int64_t place_of(uint64_t frame) const {
    if (!request_.fps) return 0;
    return av_rescale_rnd(static_cast<int64_t>(frame), kRate * request_.fps->denominator,
                          request_.fps->numerator, AV_ROUND_DOWN);
  }

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
      end_ = pictures_end_s_ ? std::llround(*pictures_end_s_ * kRate) : at_;
      const int64_t over = std::clamp<int64_t>(at_ - end_, 0, std::ssize(held_));
      held_.resize(held_.size() - static_cast<size_t>(over));
      at_ -= over;
      write({});
      if (!pictures_end_s_) return false;
      ring_.set_round(static_cast<uint64_t>(std::max(end_, at_)));
    }
    if (end_ != kNoEnd) write_silence(end_ - at_);
    return at_ > begin;
  }
  void open() {
    pictures_ = stream_ = nullptr;
    codec_.reset();
    swr_.reset();
    origin_.reset();
    read_errors_ = 0;
    container_.emplace(fd_, request_.file, true);
    const std::span streams(container_->format().streams, container_->format().nb_streams);
    for (AVStream* const one : streams) {
      if (one->index == request_.stream && one->codecpar->codec_type == AVMEDIA_TYPE_AUDIO)
        stream_ = one;
      if (pictures_ == nullptr && has_pictures(*one)) pictures_ = one;
    }
    for (AVStream* const one : streams)
      if (one != stream_ && (one != pictures_ || request_.frames > 0)) one->discard = AVDISCARD_ALL;
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
    const double to = static_cast<double>(at_) / kRate - kWarmUpSeconds;
    if (!origin_ && stream_->start_time != AV_NOPTS_VALUE)
      origin_ = seconds(stream_->start_time, *stream_);
    const int64_t time = std::llround((origin_.value_or(0.0) + to) / av_q2d(stream_->time_base));
    if (to > 0.0 &&
        av_seek_frame(&container_->format(), stream_->index, time, AVSEEK_FLAG_BACKWARD) >= 0)
      avcodec_flush_buffers(codec_.get());
  }
  /// Returns a time that the file states, which may be any number, within 30 years.
  static double seconds(int64_t time, const AVStream& stream) {
    return std::clamp(static_cast<double>(time) * av_q2d(stream.time_base), -1e9, 1e9);
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
    const int64_t time = packet.pts != AV_NOPTS_VALUE ? packet.pts : packet.dts;
    if (packet.stream_index != stream_->index && origin_ && time != AV_NOPTS_VALUE)
      pictures_end_s_ =
          std::max(pictures_end_s_.value_or(0.0),
                   seconds(time, *pictures_) + seconds(packet.duration, *pictures_) - *origin_);
    if (packet.stream_index == stream_->index && avcodec_send_packet(codec_.get(), &packet) < 0)
      note_damage();
  }
  void note_damage() {
    after_damage_ = true;
    ring_.count_damage();
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
      const int64_t stated = std::llround((seconds(pts, *stream_) - *origin_) * kRate);
      const int64_t continued = next_ + (swr_ ? swr_get_delay(swr_.get(), kRate) : 0);
      const double most = after_damage_ ? kDeviationAfterDamage : kUsualDeviation;
      if (std::abs(static_cast<double>(stated - continued)) > most * kRate) end_run();
      if (!swr_) next_ = stated;
    }
    after_damage_ = false;
    if (!swr_) begin_run();
    push(frame.extended_data, frame.nb_samples);
  }
  void begin_run() {
    AVChannelLayout to{}, from = frame_->ch_layout;  // of up to 64 channels: owns nothing
    av_channel_layout_default(&to, kChannels);
    if (from.order == AV_CHANNEL_ORDER_UNSPEC) av_channel_layout_default(&from, from.nb_channels);
    format_ = frame_->format;
    rate_ = frame_->sample_rate;
    file_channels_ = frame_->ch_layout.nb_channels;
    SwrContext* made = nullptr;
    const int error = swr_alloc_set_opts2(&made, &to, AV_SAMPLE_FMT_FLT, kRate, &from,
                                          static_cast<AVSampleFormat>(format_), rate_, 0, nullptr);
    swr_.reset(made);
    // Mono is as loud on both sides as in the file, not 3 dB below.
    if (from.nb_channels == 1 && made != nullptr)
      (void)av_opt_set_double(made, "rematrix_volume", std::numbers::sqrt2, 0);
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
    samples_.resize(static_cast<size_t>(room));
    auto* to = reinterpret_cast<uint8_t*>(samples_.data());
    const int64_t got =
        swr_convert(swr_.get(), &to, room, const_cast<const uint8_t**>(data), count);
    if (got <= 0) return;
    write_silence(std::min(next_, end_) - at_);
    const int64_t from = std::clamp<int64_t>(at_ - next_, 0, got);
    const int64_t until = std::clamp<int64_t>(end_ - next_, from, got);
    write(
        std::span(samples_).subspan(static_cast<size_t>(from), static_cast<size_t>(until - from)));
    next_ += got;
  }

  void write_silence(int64_t count) {
    static constexpr std::array<Frame, 1024> kZeros{};
    for (; count > 0; count -= 1024)
      write(std::span(kZeros).first(static_cast<size_t>(std::min<int64_t>(count, 1024))));
  }
  /// Writes samples. While the film's length is not known, those after the last picture so far are
  /// held back, because they are cut if it is the last one.
  void write(std::span<const Frame> samples) {
    held_.insert(held_.end(), samples.begin(), samples.end());
    at_ += std::ssize(samples);
    int64_t count = std::ssize(held_);
    if (end_ == kNoEnd && request_.fps && count < kMostHeld)
      count = std::clamp<int64_t>(
          std::llround(pictures_end_s_.value_or(0.0) * kRate) - (at_ - count), 0, count);
    put(std::span(held_).first(static_cast<size_t>(count)));
    held_.erase(held_.begin(), held_.begin() + count);
  }
  /// Waits while the ring is full. The kernel ends this process with the player.
  void put(std::span<const Frame> samples) {
    while (!samples.empty()) {
      const size_t room = std::min<uint64_t>(ring_.room(), samples.size());
      if (room == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
      ring_.write(samples.first(room));
      samples = samples.subspan(room);
    }
  }

  const int& fd_;
  const SoundRequest& request_;
  frames::SoundRing& ring_;
  AvPacket packet_;
  AvFrame frame_;
  std::optional<Container> container_;
  AVStream* stream_ = nullptr;
  AVStream* pictures_ = nullptr;
  AvCodec codec_;
  SwResampler swr_;
  int format_ = 0, rate_ = 0, file_channels_ = 0;  ///< format of the run
  std::vector<Frame> samples_, held_;
  int64_t at_ = 0;                ///< place in the file of the next sample of the ring
  int64_t end_ = 0;               ///< place at which the round ends
  int64_t next_ = 0;              ///< place of the next sample of the run
  std::optional<double> origin_;  ///< time 0 of the file, seconds
  std::optional<double> pictures_end_s_;
  bool after_damage_ = false;
  int read_errors_ = 0;
};

}  // namespace

int run_sound(const SoundRequest& request) {
  if (request.parent > 0 && !die_with(request.parent)) return 1;
  volunteer_for_oom();
  const UniqueFd input(open_clip_file(request.file));
  frames::SoundRing ring{UniqueFd(request.ring_fd)};
  confine(kMemoryBytes, request.parent);
  const int fd = input.get();
  SoundFeed(fd, request, ring).run();
}

}  // namespace lenticule::video
