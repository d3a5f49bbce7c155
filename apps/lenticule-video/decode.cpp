// SPDX-License-Identifier: Apache-2.0
// lenticule-video decode decodes a file's frames into a player's ring.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "apps/lenticule-video/clip_reader.h"
#include "apps/lenticule-video/confinement.h"
#include "apps/lenticule-video/hardware_decoders.h"
#include "apps/lenticule-video/pixel_convert.h"
#include "apps/lenticule-video/subcommands.h"
#include "base/error_kinds.h"
#include "base/main_function.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/image_io.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_renderer.h"

namespace lenticule::video {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr auto kTimeout = 10s;     ///< timeout for the player to listen
constexpr auto kSlotTimeout = 1s;  ///< interval at which the player's presence is checked
constexpr auto kReportInterval = 500ms;
constexpr uint64_t kMemoryBytes = uint64_t{1} << 30;
constexpr uint64_t kPicturesAtATime = 48;  ///< roughly reference frames times threads
constexpr uint64_t kMostBytesPerPixel = 8;
constexpr int kMostThreads = 4;

/// Returns the number of decoding threads. One more than cores, because the decoder's threads get
/// the next packet only when this thread has converted a picture.
int bounded_threads(int wanted) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(wanted > 0 ? wanted : std::min(cores, kMostThreads) + 1, 1, 64);
}

uint64_t memory_for(const frames::FrameGeometry& geometry) {
  const uint64_t pixels = uint64_t(geometry.width) * uint64_t(geometry.height);
  return kMemoryBytes + pixels * kMostBytesPerPixel * kPicturesAtATime;
}

/// Writes an event to standard error, which the player reads; every event must arrive.
void report_event(const json& event) {
  const std::string text = json_text(event) + "\n";
  std::string_view rest = text;
  while (!rest.empty()) {
    const ssize_t n = write(STDERR_FILENO, rest.data(), rest.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;  // the player is gone
    rest.remove_prefix(static_cast<size_t>(n));
  }
}

/// FrameTimes numbers the frames of one round by their time stamps, in periods of a constant rate,
/// and measures how much of the clip they cover.
class FrameTimes {
 public:
  FrameTimes(const ClipReader& clip, std::optional<frames::Rate> rate)
      : tick_(av_q2d(clip.stream().time_base)),
        duration_(av_q2d(av_inv_q(clip.stream().avg_frame_rate)) / tick_),
        periods_(rate ? tick_ * rate->hertz() : 0.0),
        longest_seconds_(clip.times_may_jump() ? kLongestBeforeJump : frames::kLongestFrameSeconds),
        reordered_(static_cast<uint64_t>(std::max(clip.stream().codecpar->video_delay, 0))) {}

  /// Returns the number of the last frame; 0 before the first.
  [[nodiscard]] uint64_t number() const { return number_; }
  [[nodiscard]] bool begun() const { return seen_ > 0 || resumed_; }

  /// Returns the next frame's number: 0, and then that of its time, but more than the last one. A
  /// time that goes back or jumps ahead is not followed: later times count from there.
  uint64_t place(int64_t time, int64_t duration) {
    if (begun()) ++number_;
    ++seen_;
    last_duration_ = static_cast<double>(duration);
    if (time == AV_NOPTS_VALUE) return number_;
    const auto now = static_cast<double>(time);
    const double interval = now - last_.value_or(now);
    if (!last_ || interval <= 0.0 || interval * tick_ > longest_seconds_)
      origin_ = {.time = now, .number = number_};
    number_ = std::max(number_, number_at(now));
    gaps_ += interval >= 1.5 * duration_ ? 1 : 0;
    last_ = now;
    return number_;
  }
  /// Continues before a frame of known time and number; `first` is the time of the first frame.
  void resume(int64_t first, int64_t time, uint64_t number) {
    origin_ = {.time = static_cast<double>(first), .number = 0};
    last_ = static_cast<double>(time) - 1.0;
    number_ = number - 1;
    resumed_ = true;
  }
  /// Returns the number of periods until the last frame ends.
  [[nodiscard]] uint64_t length() const {
    const bool known = last_ && last_duration_ * tick_ <= longest_seconds_;
    return std::max(number_ + 1, known ? number_at(*last_ + last_duration_) : 0);
  }

  /// Returns how many of the expected frames are missing, beside `left_out` ones.
  [[nodiscard]] uint64_t missing(const ExpectedFrames& expected, uint64_t left_out) const {
    if (resumed_ || seen_ + left_out >= expected.frames) return 0;
    const uint64_t missing = expected.frames - seen_ - left_out;
    if (!expected.by_duration || !last_) return missing;
    const double after = (expected.end - *last_) / duration_ - 1.0;
    const auto uncovered = static_cast<uint64_t>(std::max(0L, std::lround(after)));
    // A cut between packets leaves a gap of reordered frames before the last one.
    const bool cut = uncovered == 0 && missing <= reordered_;
    const bool constant_rate = gaps_ <= 1 + seen_ / 20;
    return constant_rate && !cut ? missing : std::min(missing, uncovered);
  }

 private:
  static constexpr double kLongestBeforeJump = 10.0;
  struct Origin {
    double time = 0.0;
    uint64_t number = 0;
  };

  [[nodiscard]] uint64_t number_at(double time) const {
    const double after = (time - origin_.time) * periods_;
    return origin_.number + static_cast<uint64_t>(std::llround(std::max(0.0, after)));
  }

  double tick_;      ///< seconds
  double duration_;  ///< average duration of a frame, in ticks
  double periods_;   ///< periods of the constant rate in a tick; 0: times are not followed
  double longest_seconds_;
  uint64_t reordered_;
  Origin origin_;
  std::optional<double> last_;  ///< time of the last frame
  double last_duration_ = 0.0;
  uint64_t number_ = 0;
  uint64_t seen_ = 0;
  uint64_t gaps_ = 0;  ///< number of intervals that are longer than a frame
  bool resumed_ = false;
};

/// Feed copies frames from one clip into one ring until one of them is over.
class Feed {
 public:
  Feed(const DecodeRequest& request, frames::RingRenderer& ring, ClipReader& clip)
      : request_(request),
        ring_(ring),
        clip_(clip),
        stream_tags_(tags_of(*clip.stream().codecpar)),
        times_(clip, request.rate),
        round_(request.position - request.from) {
    check_layout(evaluate_pixels(stream_tags_));
  }

  /// Returns false if the player is gone.
  [[nodiscard]] bool run() {
    bool resumes = request_.from > 0;
    for (uint64_t skip = request_.from;; resumes = false) {
      if (!play(skip, resumes)) return false;
      if (clip_length_ == 0) throw input_error("{}: no frame could be decoded", request_.file);
      report_clip();
      if (!request_.loop) break;
      // A decoder that continues another's work may not know the length of the clip.
      skip = skip > clip_length_ ? skip - clip_length_ : 0;
      round_ += clip_length_;
      start_over();
    }
    ring_.finish();
    return true;
  }

  [[nodiscard]] uint64_t published() const { return published_; }

 private:
  void check_layout(const PixelVerdict& verdict) const {
    if (!verdict.layout)
      throw input_error("{}: {}", request_.file, verdict.refusal)
          .remedy("convert it to RGB, or to Y'CbCr 4:4:4 of BT.709");
    if (verdict.layout->subsampled() && !request_.before_weaving)
      throw input_error("{}: chroma {} mixes the colours of neighbouring subpixels", request_.file,
                        verdict.sampling)
          .remedy("weave it from a quilt instead, or use --before-weaving");
  }
  /// Plays the clip once; returns false if the player is gone.
  [[nodiscard]] bool play(uint64_t skip, bool resumes) {
    const uint64_t begin = request_.begin, first = begin + skip;
    times_ = FrameTimes(clip_, request_.rate);
    if (resumes && request_.known_time && request_.known_frame > 0 && request_.known_frame <= first)
      find_known();
    while (begin + clip_length_ < request_.end) {
      if (!std::exchange(have_frame_, false) && clip_.next() == ClipReader::Step::End) break;
      if (!fits_ring()) continue;
      if (!times_.begun()) first_time_ = clip_.time();
      const uint64_t before = times_.number();
      uint64_t frame = times_.place(clip_.time(), duration_of(clip_.frame()));
      // A range that begins while a frame stays begins with the next one.
      if (before < begin && frame > begin) frame = begin;
      if (frame >= request_.end) break;
      if (frame >= begin) clip_length_ = frame - begin + 1;
      if (frame >= first && !show(frame)) return false;
      report_position(frame);
    }
    if (clip_length_ > 0) clip_length_ = std::min(times_.length(), request_.end) - begin;
    return true;
  }
  /// Moves the reader to the known frame if the file leads there. The first frame tells where time
  /// begins, and may be the only one that tells which eye a view is for.
  void find_known() {
    const int64_t known = *request_.known_time;
    if (clip_.next() == ClipReader::Step::Frame) first_time_ = clip_.time();
    if (first_time_ != AV_NOPTS_VALUE && clip_.seek(known)) {
      while (clip_.next() == ClipReader::Step::Frame) {
        have_frame_ = clip_.time() == known && fits_ring();
        if (have_frame_) return times_.resume(first_time_, known, request_.known_frame);
        if (clip_.time() == AV_NOPTS_VALUE || clip_.time() > known) break;
      }
    }
    clip_.reopen();
  }
  /// Returns to the start. Seeking is fast and is accepted only if it leads to the first frame.
  void start_over() {
    clip_length_ = 0;
    if (first_time_ != AV_NOPTS_VALUE && clip_.seek(first_time_) &&
        clip_.next() == ClipReader::Step::Frame && clip_.time() == first_time_) {
      have_frame_ = true;
      return;
    }
    clip_.reopen();
  }
  [[nodiscard]] bool fits_ring() {
    const AVFrame& frame = clip_.frame();
    const AVFrame* const second = clip_.second_view();
    frames::FrameGeometry size =
        frames::oriented_geometry({.width = frame.width, .height = frame.height}, orientation());
    const bool equal =
        second == nullptr || (second->width == frame.width && second->height == frame.height &&
                              second->format == frame.format);
    if (second != nullptr) size.width *= 2;
    if (equal && size == ring_.geometry()) return true;
    ++wrong_size_;
    return false;
  }
  [[nodiscard]] bool show(uint64_t frame) {
    prepare_converter();
    const uint64_t number =
        frames::ring_number(round_ + frame - request_.begin, frame == request_.begin);
    std::span<uint8_t> slot;
    frames::RingStatus status = frames::RingStatus::TimedOut;
    while (status == frames::RingStatus::TimedOut)
      status = ring_.acquire(number, kSlotTimeout, slot);
    if (status == frames::RingStatus::Gone) return false;
    fill(slot);
    if (ring_.publish() == frames::RingStatus::Gone) return false;
    ++published_;
    return true;
  }
  /// Reports a position from which another process could continue, and that this process is alive
  /// while it skips frames.
  void report_position(uint64_t frame) {
    const Clock::time_point now = Clock::now();
    const int64_t previous = std::exchange(previous_time_, clip_.time());
    if (now - last_report_ < kReportInterval) return;
    if (!is_key_frame(clip_.frame()) && published_ > 0) return;
    if (clip_.time() <= previous && published_ > 0) return;
    last_report_ = now;
    json event = {{"event", "position"}, {"frame", frame}, {"time", nullptr}};
    if (clip_.time() != AV_NOPTS_VALUE) event["time"] = clip_.time();
    report_event(event);
    report_broken();
  }
  void report_broken() {
    const uint64_t broken = clip_.broken_packets() + wrong_size_ + clip_.faulty_frames();
    if (broken == reported_broken_) return;
    reported_broken_ = broken;
    report_event({{"event", "broken"}, {"count", broken}});
  }
  /// Reports the end of a round: its length, and the number of frames that the file claims to have,
  /// and which neither came nor were left out.
  void report_clip() {
    report_broken();
    const uint64_t left_out = clip_.broken_packets() + wrong_size_;
    const uint64_t in_round = left_out - std::exchange(left_out_before_, left_out);
    // A range ends at a known frame; a container may be wrong about its last frame.
    const bool whole = request_.begin == 0 && request_.end == DecodeRequest{}.end;
    const std::optional<ExpectedFrames> expected = clip_.expected();
    report_event(
        {{"event", "clip"},
         {"frames", clip_length_},
         {"missing", whole && expected ? times_.missing(*expected, in_round) : uint64_t{0}}});
  }
  [[nodiscard]] frames::Orientation orientation() const {
    return static_cast<frames::Orientation>(request_.orientation);
  }
  /// Fills a slot with the picture, or with those of both eyes side by side.
  void fill(std::span<uint8_t> slot) {
    const AVFrame* const second = clip_.second_view();
    if (second == nullptr) return convert(clip_.frame(), slot);
    eye_.resize(slot.size() / 2);
    const size_t row = slot.size() / 2 / static_cast<size_t>(ring_.geometry().height);
    for (const bool right : {false, true}) {
      convert(right == clip_.begins_with_right() ? clip_.frame() : *second, eye_);
      for (size_t from = 0; from < eye_.size(); from += row)
        std::ranges::copy(std::span(eye_).subspan(from, row),
                          slot.subspan(2 * from + (right ? row : 0)).begin());
    }
  }
  void convert(const AVFrame& frame, std::span<uint8_t> out) {
    PicturePlanes picture{.width = frame.width, .height = frame.height};
    for (size_t i = 0; i < picture.data.size(); ++i) {
      picture.data[i] = frame.data[i];
      picture.stride[i] = frame.linesize[i];
    }
    if (orientation() == frames::Orientation::Upright) return converter_->convert(picture, out);
    const frames::FrameGeometry stored{.width = picture.width, .height = picture.height};
    stored_.resize(stored.frame_bytes());
    converter_->convert(picture, stored_);
    frames::turn_upright(stored_, stored, orientation(), out);
  }
  void prepare_converter() {
    const PixelTags tags = tags_of(clip_.frame(), stream_tags_);
    if (converter_ && converter_tags_ == tags) return;
    const PixelVerdict verdict = evaluate_pixels(tags);
    check_layout(verdict);
    converter_.emplace(*verdict.layout, clip_.frame().width, clip_.frame().height);
    converter_tags_ = tags;
  }

  const DecodeRequest& request_;
  frames::RingRenderer& ring_;
  ClipReader& clip_;
  PixelTags stream_tags_;
  std::optional<PixelTags> converter_tags_;
  std::optional<PixelConverter> converter_;
  int64_t first_time_ = AV_NOPTS_VALUE;  ///< time of the file's frame 0
  int64_t previous_time_ = AV_NOPTS_VALUE;
  bool have_frame_ = false;  ///< the reader already holds the next frame
  FrameTimes times_;
  uint64_t round_;            ///< position of the round's first frame in the ring
  uint64_t clip_length_ = 0;  ///< periods of this round so far
  uint64_t published_ = 0;
  uint64_t wrong_size_ = 0;
  uint64_t reported_broken_ = 0;
  uint64_t left_out_before_ = 0;  ///< frames left out in earlier rounds
  std::vector<uint8_t> stored_;   ///< a frame before rotation
  std::vector<uint8_t> eye_;      ///< one eye's picture
  Clock::time_point last_report_ = Clock::now();
};

void report_choice(const DecoderChoice& choice) {
  report_event({{"event", "decoder"},
                {"decoder", choice.name},
                {"hardware", choice.hardware},
                {"reason", choice.reason}});
}

[[nodiscard]] Error no_hardware(const DecodeRequest& request, const std::string& reason) {
  return {ErrorKind::Device, fmt::format("{}: not decoded in hardware: {}", request.file, reason),
          "use --decoder software"};
}

/// Reports that another decoder is in use. Throws if the request forbids it.
void accept_choice(const DecodeRequest& request, const DecoderChoice& choice) {
  if (request.decoder == Decoder::Hardware && !choice.hardware)
    throw no_hardware(request, choice.reason);
  report_choice(choice);
}

/// Ends the process, whose device fails. The player starts another one.
[[noreturn]] void end_failed(const DecodeRequest& request, const DecoderChoice& choice) {
  report_choice(choice);
  _exit(report_error(no_hardware(request, choice.reason), {.program = "lenticule-video"}));
}

/// Returns the devices that may decode the file. Woven frames have full chroma, which they do not
/// give.
std::vector<HardwareDecoder> wanted_hardware(const DecodeRequest& request) {
  const bool required = request.decoder == Decoder::Hardware;
  if (request.decoder == Decoder::Software) return {};
  if (required && !request.before_weaving)
    throw no_hardware(request, "devices give chroma of lower resolution, for --before-weaving");
  if (!request.before_weaving) return {};
  std::vector<HardwareDecoder> found = find_hardware_decoders();
  if (required && found.empty())
    throw no_hardware(request, "no /dev/video* that this user may open is a decoder");
  return found;
}

/// Confines the process; returns the devices that it may still open.
std::vector<HardwareDecoder> confine_to(const DecodeRequest& request, uint64_t memory) {
  std::vector<HardwareDecoder> hardware = wanted_hardware(request);
  if (hardware.empty()) {
    confine(memory, request.parent);
    return {};
  }
  std::vector<std::string> nodes;
  for (const HardwareDecoder& device : hardware) nodes.push_back(device.node);
  const std::string obstacle = confine_with_devices(memory, request.parent, nodes);
  if (obstacle.empty()) return hardware;
  accept_choice(request, {.name = "software", .hardware = false, .reason = obstacle});
  return {};
}

}  // namespace

int run_decode(const DecodeRequest& request) {
  if (request.parent > 0 && !die_with(request.parent)) return 1;
  volunteer_for_oom();
  const UniqueFd input(open_clip_file(request.file));
  const auto ring = frames::RingRenderer::connect(request.ring,
                                                  {.name = "lenticule-video",
                                                   .rig_fingerprint = request.rig_fingerprint,
                                                   .rate = std::nullopt,
                                                   .frame_count = std::nullopt},
                                                  kTimeout);
  ClipOptions options{
      .stream = request.stream,
      .threads = bounded_threads(request.threads),
      .hardware = confine_to(request, memory_for(ring->geometry())),
      .on_choice = [&](const DecoderChoice& choice) { accept_choice(request, choice); },
      .on_failure = [&](const DecoderChoice& choice) { end_failed(request, choice); }};
  const int fd = input.get();
  ClipReader clip(fd, request.file, std::move(options));
  Feed feed(request, *ring, clip);
  const bool finished = feed.run();
  report_event({{"event", finished ? "end" : "player_gone"}, {"published", feed.published()}});
  return finished ? 0 : 1;
}

}  // namespace lenticule::video
