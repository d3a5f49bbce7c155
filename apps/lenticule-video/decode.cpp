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
#include "base/error.h"
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

/// Cadence measures how much of a clip the frames of one round cover.
class Cadence {
 public:
  explicit Cadence(const AVStream& stream)
      : duration_(av_q2d(av_inv_q(stream.avg_frame_rate)) / av_q2d(stream.time_base)),
        reordered_(static_cast<uint64_t>(std::max(stream.codecpar->video_delay, 0))) {}

  void note(int64_t time) {
    if (time == AV_NOPTS_VALUE) return;
    if (last_ && time > *last_) {
      ++intervals_;
      const double interval = static_cast<double>(time) - static_cast<double>(*last_);
      if (interval < 1.5 * duration_) ++single_;
    }
    last_ = std::max(time, last_.value_or(time));
  }

  /// Returns how many of the expected frames are missing if `seen` arrived.
  [[nodiscard]] uint64_t missing(const ExpectedFrames& expected, uint64_t seen) const {
    if (seen >= expected.frames) return 0;
    const uint64_t missing = expected.frames - seen;
    if (!expected.by_duration || !last_) return missing;
    const double after = (expected.end - static_cast<double>(*last_)) / duration_ - 1.0;
    const auto uncovered = static_cast<uint64_t>(std::max(0L, std::lround(after)));
    // A cut between packets leaves a gap of reordered frames before the last one.
    const bool cut = uncovered == 0 && missing <= reordered_;
    const bool constant_rate = 4 * single_ >= 3 * intervals_;
    return constant_rate && !cut ? missing : std::min(missing, uncovered);
  }

 private:
  double duration_;  ///< duration of a frame, in units of the time stamps
  uint64_t reordered_;
  std::optional<int64_t> last_;
  uint64_t intervals_ = 0;
  uint64_t single_ = 0;  ///< number of intervals that are not longer than a frame
};

/// Feed copies frames from one clip into one ring until one of them is over.
class Feed {
 public:
  Feed(const DecodeRequest& request, frames::RingRenderer& ring, ClipReader& clip)
      : request_(request),
        ring_(ring),
        clip_(clip),
        stream_tags_(tags_of(*clip.stream().codecpar)),
        cadence_(clip.stream()) {
    check_layout(evaluate_pixels(stream_tags_));
    first_time_ = AV_NOPTS_VALUE;
  }

  /// Returns false if the player is gone.
  [[nodiscard]] bool run() {
    bool resumes = request_.from > 0;
    for (uint64_t skip = request_.from;; resumes = false) {
      if (!play(skip, resumes)) return false;
      if (clip_length_ == 0)
        throw Error(ErrorKind::Input, request_.file + ": no frame could be decoded");
      report_clip();
      if (!request_.loop) break;
      // A decoder that continues another's work may not know the length of the clip.
      skip = skip > clip_length_ ? skip - clip_length_ : 0;
      start_over();
    }
    ring_.finish();
    return true;
  }

  [[nodiscard]] uint64_t published() const { return published_; }

 private:
  void check_layout(const PixelVerdict& verdict) const;
  [[nodiscard]] bool play(uint64_t skip, bool resumes);
  [[nodiscard]] uint64_t find_start(uint64_t wanted);
  [[nodiscard]] std::optional<uint64_t> find_known();
  void start_over();
  [[nodiscard]] bool fits_ring();
  [[nodiscard]] bool show(bool begins_clip);
  void report_position(uint64_t frame);
  void report_broken();
  void report_clip();
  [[nodiscard]] frames::Orientation orientation() const {
    return static_cast<frames::Orientation>(request_.orientation);
  }
  void fill(std::span<uint8_t> slot);
  void convert(const AVFrame& frame, std::span<uint8_t> out);
  void prepare_converter();

  const DecodeRequest& request_;
  frames::RingRenderer& ring_;
  ClipReader& clip_;
  PixelTags stream_tags_;
  std::optional<PixelTags> converter_tags_;
  std::optional<PixelConverter> converter_;
  int64_t first_time_ = AV_NOPTS_VALUE;  ///< time of the file's frame 0
  int64_t previous_time_ = AV_NOPTS_VALUE;
  bool have_frame_ = false;   ///< the reader already holds the next frame
  uint64_t clip_length_ = 0;  ///< number of frames seen so far
  uint64_t published_ = 0;
  uint64_t wrong_size_ = 0;
  uint64_t reported_broken_ = 0;
  uint64_t left_out_before_ = 0;  ///< frames left out in earlier rounds
  Cadence cadence_;
  std::vector<uint8_t> stored_;  ///< a frame before rotation
  std::vector<uint8_t> eye_;     ///< one eye's picture
  Clock::time_point last_report_ = Clock::now();
};

void Feed::check_layout(const PixelVerdict& verdict) const {
  if (!verdict.layout)
    throw Error(ErrorKind::Input, request_.file + ": " + verdict.refusal,
                "convert it to RGB, or to Y'CbCr 4:4:4 of BT.709");
  if (verdict.layout->subsampled() && !request_.before_weaving)
    throw Error(ErrorKind::Input,
                request_.file + ": chroma " + verdict.sampling +
                    " mixes the colours of neighbouring subpixels",
                "weave it from a quilt instead, or use --before-weaving");
}

bool Feed::fits_ring() {
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

/// Moves the reader to the first wanted frame or one before it; returns its number.
uint64_t Feed::find_start(uint64_t wanted) {
  if (request_.known_time && request_.known_frame > 0 && request_.known_frame <= wanted)
    if (const auto found = find_known()) return *found;
  return 0;
}

std::optional<uint64_t> Feed::find_known() {
  // The first frame may be the only one that tells which eye a view is for.
  if (clip_.second_view() != nullptr) static_cast<void>(clip_.next());
  if (clip_.seek(*request_.known_time)) {
    while (clip_.next() == ClipReader::Step::Frame) {
      const int64_t time = clip_.time();
      if (time == *request_.known_time && fits_ring()) {
        have_frame_ = true;
        return request_.known_frame;
      }
      if (time == AV_NOPTS_VALUE || time > *request_.known_time) break;
    }
  }
  clip_.reopen();
  return std::nullopt;
}

/// Plays the clip once; returns false if the player is gone.
bool Feed::play(uint64_t skip, bool resumes) {
  const uint64_t first = request_.begin + skip;
  for (uint64_t frame = resumes ? find_start(first) : 0; frame < request_.end;) {
    if (!have_frame_ && clip_.next() == ClipReader::Step::End) break;
    have_frame_ = false;
    if (!fits_ring()) continue;
    if (frame == 0) first_time_ = clip_.time();
    cadence_.note(clip_.time());
    if (frame >= request_.begin) clip_length_ = frame - request_.begin + 1;
    if (frame >= first && !show(frame == request_.begin)) return false;
    report_position(frame);
    ++frame;
  }
  return true;
}

/// Returns to the start. Seeking is fast and is accepted only if it leads to the first frame.
void Feed::start_over() {
  clip_length_ = 0;
  cadence_ = Cadence(clip_.stream());
  if (first_time_ != AV_NOPTS_VALUE && clip_.seek(first_time_) &&
      clip_.next() == ClipReader::Step::Frame && clip_.time() == first_time_) {
    have_frame_ = true;
    return;
  }
  clip_.reopen();
}

void Feed::prepare_converter() {
  const PixelTags tags = tags_of(clip_.frame(), stream_tags_);
  if (converter_ && converter_tags_ == tags) return;
  const PixelVerdict verdict = evaluate_pixels(tags);
  check_layout(verdict);
  converter_.emplace(*verdict.layout, clip_.frame().width, clip_.frame().height);
  converter_tags_ = tags;
}

bool Feed::show(bool begins_clip) {
  prepare_converter();
  const uint64_t number = frames::ring_number(request_.position + published_, begins_clip);
  std::span<uint8_t> slot;
  frames::RingStatus status = frames::RingStatus::TimedOut;
  while (status == frames::RingStatus::TimedOut) status = ring_.acquire(number, kSlotTimeout, slot);
  if (status == frames::RingStatus::Gone) return false;
  fill(slot);
  if (ring_.publish() == frames::RingStatus::Gone) return false;
  ++published_;
  return true;
}

/// Fills a slot with the picture, or with those of both eyes side by side.
void Feed::fill(std::span<uint8_t> slot) {
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

void Feed::convert(const AVFrame& frame, std::span<uint8_t> out) {
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

/// Reports a position from which another process could continue, and that this process is alive
/// while it skips frames.
void Feed::report_position(uint64_t frame) {
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

void Feed::report_broken() {
  const uint64_t broken = clip_.broken_packets() + wrong_size_ + clip_.faulty_frames();
  if (broken == reported_broken_) return;
  reported_broken_ = broken;
  report_event({{"event", "broken"},
                {"packets", clip_.broken_packets()},
                {"wrong_size", wrong_size_},
                {"faulty", clip_.faulty_frames()}});
}

/// Reports the end of a round: the number of frames that the file claims to have, and which neither
/// came nor were left out.
void Feed::report_clip() {
  report_broken();
  const uint64_t left_out = clip_.broken_packets() + wrong_size_;
  const uint64_t seen = clip_length_ + left_out - std::exchange(left_out_before_, left_out);
  // A range ends at a known frame; a container may be wrong about its last frame.
  const bool whole = request_.begin == 0 && request_.end == DecodeRequest{}.end;
  const std::optional<ExpectedFrames> expected = clip_.expected();
  report_event({{"event", "clip"},
                {"missing", whole && expected ? cadence_.missing(*expected, seen) : uint64_t{0}}});
}

void report_choice(const DecoderChoice& choice) {
  json event = {{"event", "decoder"},
                {"decoder", choice.name},
                {"hardware", choice.hardware},
                {"reason", nullptr}};
  if (!choice.reason.empty()) event["reason"] = choice.reason;
  report_event(event);
}

[[nodiscard]] Error no_hardware(const DecodeRequest& request, const std::string& reason) {
  return {ErrorKind::Device, fmt::format("{}: not decoded in hardware: {}", request.file, reason),
          "use --decoder auto or --decoder software"};
}

/// Reports that another decoder is in use. Throws if the request forbids it.
void accept_choice(const DecodeRequest& request, const DecoderChoice& choice) {
  if (request.decoder == Decoder::Hardware && !choice.hardware)
    throw no_hardware(request, choice.reason);
  report_choice(choice);
}

/// Ends the process: the thread that decodes waits for the device. The player starts another one.
[[noreturn]] void end_hung(const DecodeRequest& request, const DecoderChoice& choice) {
  const std::string reason = fmt::format("hardware decoder {} does not answer", choice.name);
  report_choice({.name = choice.name, .hardware = true, .reason = reason});
  _exit(report_error(
      {ErrorKind::Device, fmt::format("{}: {}", request.file, reason), "use --decoder software"},
      {.program = "lenticule-video"}));
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
      .on_hang = [&](const DecoderChoice& choice) { end_hung(request, choice); }};
  const int fd = input.get();
  ClipReader clip(fd, request.file, std::move(options));
  Feed feed(request, *ring, clip);
  const bool finished = feed.run();
  report_event({{"event", finished ? "end" : "player_gone"}, {"published", feed.published()}});
  return finished ? 0 : 1;
}

}  // namespace lenticule::video
