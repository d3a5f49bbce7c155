// SPDX-License-Identifier: Apache-2.0
#include "player/sources/video_source.h"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <deque>
#include <string_view>
#include <utility>

#include "base/error_kinds.h"
#include "base/exit_code.h"
#include "base/print.h"
#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"
#include "player/process/private_folder.h"
#include "player/sources/content.h"
#include "player/sources/video_child.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr int kLeastSlots = 4;  ///< a ring's minimum of three, and the frame that follows
constexpr size_t kMostRestarts = 3;
constexpr auto kRestartWindow = 60s;
/// Timeout for the start: loading some hundred libraries on a busy machine may take long.
constexpr std::chrono::milliseconds kStartTimeout = 60s;

// --- streams --------------------------------------------------------------------------------

const VideoStream& choose_stream(const std::vector<VideoStream>& streams,
                                 const VideoRequest& request) {
  if (!request.stream) return streams.front();
  for (const VideoStream& stream : streams)
    if (stream.index == *request.stream) return stream;
  throw usage_error("{}: stream {} has no pictures", request.file.string(), *request.stream)
      .remedy("lenticule-video probe lists the streams");
}

frames::FrameGeometry upright_geometry(const VideoStream& stream) {
  frames::FrameGeometry size = frames::oriented_geometry(stream.geometry, *stream.orientation);
  size.width *= stream.views;
  return size;
}

/// Refuses tags that would require changing the pixels of woven frames.
void refuse_tags_of_woven(const VideoStream& stream, const std::string& file) {
  constexpr double kSquare = 0.005;
  if (stream.orientation != frames::Orientation::Upright)
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: is tagged to be rotated, and woven frames are never rotated", file),
        "remove its rotation, or rotate the views before they are woven");
  if (std::abs(stream.pixel_aspect - 1.0) > kSquare)
    throw input_error(
        "{}: its pixels are tagged {:.3g} times as wide as high, and woven frames are never scaled",
        file, stream.pixel_aspect)
        .remedy("remove the sample aspect ratio, or scale the views before they are woven");
}

void refuse_unsuitable(const VideoStream& stream, const VideoRequest& request) {
  const std::string file = request.file.string();
  if (!stream.refusal.empty())
    throw input_error("{}: {}", file, stream.refusal)
        .remedy(stream.pixel_format.empty() ? "convert it, for example to FFV1 or H.264"
                                            : "convert it to RGB, or to Y'CbCr 4:4:4 of BT.709");
  if (!stream.orientation)
    throw input_error("{}: is tagged to be rotated, but not by quarter turns", file)
        .remedy("remove its rotation");
  if (!request.before_weaving) refuse_tags_of_woven(stream, file);
  if (!stream.full_chroma && !request.before_weaving)
    throw input_error("{}: {} chroma ({}) mixes the colours of neighbouring subpixels", file,
                      stream.sampling, stream.pixel_format)
        .remedy(remedy_of_unwoven(upright_geometry(stream)));
}

VideoStream suitable_stream(const VideoRequest& request) {
  const VideoStream stream = choose_stream(probe_video(request.file, request.program), request);
  refuse_unsuitable(stream, request);
  if (request.accept) request.accept(upright_geometry(stream));
  return stream;
}

uint64_t slots_for(const VideoStream& stream, const VideoRequest& request) {
  const uint64_t fit = request.most_bytes / upright_geometry(stream).frame_bytes();
  const auto most = static_cast<uint64_t>(std::max(request.slots, kLeastSlots));
  return std::clamp<uint64_t>(fit, kLeastSlots, most);
}

/// Number of decoders in hardware that failed, crashed or hung. After kMostHardwareFailures, all
/// videos of this player are decoded in software, so that a bad driver does not delay each of them.
std::atomic<int> hardware_failures{0};
constexpr int kMostHardwareFailures = 3;

/// Returns true for streams that hardware decoders may have been made for. All others are decoded
/// by a process that cannot open a device.
bool may_use_hardware(const VideoStream& stream, const VideoRequest& request) {
  constexpr std::array<std::string_view, 6> kCodecs = {"h264", "hevc",  "vp8",
                                                       "vp9",  "mpeg4", "mpeg2video"};
  const bool known = std::ranges::find(kCodecs, stream.codec) != kCodecs.end();
  const bool bytes = stream.pixel_format == "yuv420p" || stream.pixel_format == "yuvj420p";
  if (hardware_failures >= kMostHardwareFailures) return false;
  return request.hardware && request.before_weaving && known && bytes && stream.views == 1;
}

class Source final : public VideoSource {
 public:
  explicit Source(const VideoRequest& request)
      : request_(request),
        program_(request.program.empty() ? find_video_program() : request.program),
        stream_(suitable_stream(request)),
        upright_(upright_geometry(stream_)),
        hardware_(may_use_hardware(stream_, request_)),
        slots_(slots_for(stream_, request)),
        ring_(frames::RingPlayer::open({.socket = folder_.path() / "ring",
                                        .geometry = upright_,
                                        .slots = static_cast<int>(slots_),
                                        .rig_fingerprint = {}})),
        uses_(slots_),
        most_repeats_(1 + static_cast<uint64_t>(frames::kLongestFrameSeconds *
                                                stream_.rate.value_or(frames::Rate{}).hertz())),
        events_(::epoll_create1(EPOLL_CLOEXEC)) {
    if (!events_ || !watch(ring_->wake_fd()) || !watch(child_.wake_fd()))
      throw Error(ErrorKind::Failed, "video: no file descriptor is left");
    begin_child();
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return upright_; }
  [[nodiscard]] frames::FrameDamage damage() const override {
    return {.damaged = broken_before_.load() + child_.broken(), .missing = child_.missing()};
  }
  [[nodiscard]] std::string video_decoder() const override {
    const std::optional<VideoEvent> choice = child_.decoder();
    if (!choice) return {};
    if (choice->hardware && hardware_) return choice->decoder;
    return "software: " + (choice->reason.empty() ? choice->decoder + " ended" : choice->reason);
  }
  [[nodiscard]] double pixel_aspect() const override {
    return frames::upright_pixel_aspect({.geometry = stream_.geometry,
                                         .orientation = *stream_.orientation,
                                         .pixel_aspect = stream_.pixel_aspect});
  }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return stream_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return frames_in_loop_; }
  [[nodiscard]] PullStatus pull(frames::AcquiredFrame& out) override {
    if (out_of_order_) return PullStatus::Failed;
    if (at_end_) return PullStatus::End;
    const PullStatus status = following_ ? PullStatus::Ready : pull_following();
    if (status == PullStatus::Failed) return status;
    if (status == PullStatus::Ready) {
      if (frames::position_of(following_->number) > position_) return give(out, true);
      if (frames::begins_clip(following_->number) && next_ > 0) return end_round();
      drop_current();
      current_ = std::exchange(following_, std::nullopt);
      return give(out, false);
    }
    // A decoder that was replaced after its last frame leaves an empty sequence.
    if (status == PullStatus::End && !request_.plays_again && next_ > 0) {
      // The clip's length and the left-out frames are known once the decoder has reported them or
      // is dead.
      complete_ = true;
      const uint64_t length = child_.clip_length();
      if (current_ && next_ < length && length - next_ <= most_repeats_) return give(out, true);
      if (!child_.present() || length > 0) return end_round();
    }
    supervise();
    return failure_.empty() ? PullStatus::NotYet : PullStatus::Failed;
  }
  void release(uint64_t token) override {
    if (--uses_[token] > 0) return;
    --acquired_;
    ring_->release(token);
  }
  /// The source itself keeps the current frame and the one that follows.
  [[nodiscard]] int max_acquired() const override { return ring_->max_acquired() - 2; }
  [[nodiscard]] uint64_t ready_count() const override {
    return ring_->ready_count() + (following_ ? 1 : 0);
  }
  [[nodiscard]] bool saturated() const override { return ring_->saturated() || !failure_.empty(); }
  [[nodiscard]] bool rewind() override {
    if (!at_end_) return next_ == 0;
    at_end_ = false;
    next_ = 0;
    ++loop_;
    if (!request_.plays_again && !child_.present()) begin_child();
    return true;
  }
  [[nodiscard]] int wake_fd() const override { return events_.get(); }
  void service() override {
    ring_->service();
    supervise();
  }
  [[nodiscard]] std::string failure() const override { return failure_; }
  [[nodiscard]] VideoStatistics statistics() const override {
    VideoStatistics now = counts_;
    now.broken = child_.broken();
    now.decoder = child_.pid();
    return now;
  }

 private:
  [[nodiscard]] bool watch(int fd) const {
    epoll_event event = {};
    event.events = EPOLLIN;
    event.data.fd = fd;
    return ::epoll_ctl(events_.get(), EPOLL_CTL_ADD, fd, &event) == 0;
  }
  /// Takes the following frame from the ring. Returns Failed if it is out of order.
  [[nodiscard]] PullStatus pull_following() {
    frames::AcquiredFrame acquired;
    const PullStatus status = ring_->pull(acquired);
    if (status != PullStatus::Ready) return status;
    ++acquired_;
    uses_[acquired.token] = 1;
    const uint64_t position = frames::position_of(acquired.number);
    const bool begun = next_ > 0;
    if (position >= position_ && position - position_ <= (begun ? most_repeats_ : 0) &&
        (begun || frames::begins_clip(acquired.number))) {
      following_ = acquired;
      return status;
    }
    release(acquired.token);
    out_of_order_ = true;
    failure_ = fmt::format("{}: the decoder sent frame {} instead of {}", request_.file.string(),
                           position, position_);
    child_.kill();
    return PullStatus::Failed;
  }
  [[nodiscard]] PullStatus give(frames::AcquiredFrame& out, bool repeats) {
    out = *current_;
    out.repeats = repeats;
    out.number = next_++;
    ++position_;
    ++uses_[out.token];
    return PullStatus::Ready;
  }
  [[nodiscard]] PullStatus end_round() {
    drop_current();
    at_end_ = true;
    frames_in_loop_ = next_;
    return PullStatus::End;
  }
  void drop_current() {
    if (current_) release(std::exchange(current_, std::nullopt)->token);
  }
  /// Starts a decoder at the frame after the last one in the ring. A number beyond the clip's end,
  /// which only the decoder knows, continues in the next loop.
  void begin_child() {
    const std::optional<VideoEvent> choice = child_.decoder();
    if (choice && !choice->hardware) hardware_ = false;
    if (const auto last = ring_->last_number())
      delivered_ = std::max(delivered_, frames::position_of(*last) + 1);
    const uint64_t position = std::max(delivered_, position_);
    const bool next_round = following_ && frames::begins_clip(following_->number);
    const uint64_t round = next_round ? frames::position_of(following_->number) : position_ - next_;
    const FrameRange range =
        request_.frames.value_or(FrameRange{0, std::numeric_limits<uint64_t>::max()});
    std::vector<std::string> arguments = {program_.string(), kForThisVersion,
                                          "decode",          "--parent=" + std::to_string(getpid()),
                                          "--ring",          (folder_.path() / "ring").string(),
                                          "--stream",        std::to_string(stream_.index),
                                          "--begin",         std::to_string(range.begin),
                                          "--end",           std::to_string(range.end),
                                          "--from",          std::to_string(position - round),
                                          "--position",      std::to_string(position)};
    if (stream_.rate)
      arguments.insert(arguments.end(), {"--rate", frames::to_string(*stream_.rate)});
    const std::optional<VideoEvent> known = child_.position();
    if (known && known->time && known->frame <= range.begin + position - round)
      arguments.insert(arguments.end(), {"--known-frame", std::to_string(known->frame),
                                         "--known-time=" + std::to_string(*known->time)});
    if (request_.plays_again) arguments.emplace_back("--loop");
    if (request_.before_weaving) arguments.emplace_back("--before-weaving");
    arguments.insert(arguments.end(), {"--decoder", hardware_ ? "auto" : "software"});
    arguments.insert(arguments.end(), {"--", request_.file.string()});
    if (*stream_.orientation != frames::Orientation::Upright)
      arguments.insert(arguments.end() - 2,
                       {"--orientation", std::to_string(static_cast<int>(*stream_.orientation))});
    broken_before_.fetch_add(child_.broken());
    complete_ = false;
    child_loop_ = loop_;
    child_showed_life_ = killed_ = false;
    last_sign_ = last_look_ = Clock::now();
    child_.start(std::move(arguments));
  }
  /// Handles the end of a child, once the ring has taken over everything that it had published.
  void supervise() {
    if (const auto end = burying_ ? std::nullopt : child_.take_end()) {
      end_ = *end;
      burying_ = true;
    }
    if (!burying_) return watch_for_hang();
    ring_->service();
    if (ring_->renderer_connected()) return;
    burying_ = false;
    bury();
  }
  void bury() {
    if (!failure_.empty()) return;
    const bool complete = end_.exit_code == kOk && !request_.plays_again;
    if (complete && child_loop_ == loop_) return;  // pull() returns the end when it gets there
    const bool sent_all = complete_ && child_loop_ == loop_;
    if ((at_end_ || sent_all) && !request_.plays_again) return;
    if (complete) return begin_child();
    const bool final_word = end_.exit_code == kInput || end_.exit_code == kUsage;
    if (!final_word && may_restart()) {
      say("{}: the decoder {}: {}; another one continues, restart {}\n", request_.file.string(),
          killed_ ? "hung" : "ended", end_.text(), counts_.restarts);
      return begin_child();
    }
    failure_ =
        fmt::format("{}: {}: {}", request_.file.string(),
                    final_word ? "cannot be decoded" : "the decoder ends repeatedly", end_.text());
  }
  /// Counts the restart. The new decoder is a software decoder, in case a device is at fault.
  [[nodiscard]] bool may_restart() {
    const std::optional<VideoEvent> choice = child_.decoder();
    if (hardware_.exchange(false) && choice && choice->hardware) ++hardware_failures;
    const Clock::time_point now = Clock::now();
    while (!restarts_.empty() && now - restarts_.front() > kRestartWindow) restarts_.pop_front();
    if (restarts_.size() >= kMostRestarts) return false;
    restarts_.push_back(now);
    ++counts_.restarts;
    return true;
  }
  /// Kills a decoder that hangs. Time counts only while the player pulls and the decoder has a free
  /// slot, so that a pause is not taken for a hang.
  void watch_for_hang() {
    if (!child_.present() || killed_) return;
    const Clock::time_point now = Clock::now();
    const uint64_t signs = position_ + ring_->ready_count() + child_.events();
    const bool looked_away = now - std::exchange(last_look_, now) > request_.timeout / 2;
    const bool full = ring_->ready_count() + acquired_ >= slots_;
    if (signs != signs_) child_showed_life_ = true;
    if (std::exchange(signs_, signs) != signs || looked_away || full) last_sign_ = now;
    const auto timeout =
        child_showed_life_ ? request_.timeout : std::max(request_.timeout, kStartTimeout);
    if (now - last_sign_ < timeout) return;
    killed_ = true;
    ++counts_.hangs;
    child_.kill();
  }

  const VideoRequest request_;
  const std::filesystem::path program_;
  const VideoStream stream_;
  const frames::FrameGeometry upright_;
  std::atomic<bool> hardware_;  ///< the next decoder may use a device
  const uint64_t slots_;
  const PrivateFolder folder_;
  std::unique_ptr<frames::RingPlayer> ring_;
  std::vector<int> uses_;  ///< users of each slot of the ring, here and in the player
  const uint64_t most_repeats_;
  UniqueFd events_;

  uint64_t loop_ = 0;      ///< loop of the next pull()
  uint64_t next_ = 0;      ///< frame that pull() expects
  bool complete_ = false;  ///< the present decoder has sent all frames
  bool at_end_ = false;    ///< End was returned and rewind() not called
  /// The current frame is given again until the position of the following one.
  std::optional<frames::AcquiredFrame> current_, following_;
  std::optional<uint64_t> frames_in_loop_;
  uint64_t position_ = 0;   ///< position of the next pull(), in all loops
  uint64_t delivered_ = 0;  ///< position after the last frame of all decoders before
  uint64_t acquired_ = 0;   ///< slots in use

  uint64_t child_loop_ = 0;  ///< loop in which the present child was started
  bool burying_ = false;     ///< the child is dead, but the ring may not have noticed yet
  ChildEnd end_;
  std::string failure_;
  bool out_of_order_ = false;

  std::deque<Clock::time_point> restarts_;
  VideoStatistics counts_;
  std::atomic<uint64_t> broken_before_{0};  ///< count of the decoders before the present one
  bool child_showed_life_ = false;
  bool killed_ = false;
  uint64_t signs_ = 0;
  Clock::time_point last_sign_;
  Clock::time_point last_look_;
  VideoChild child_;  // last member, so that it is destroyed first
};

}  // namespace

std::unique_ptr<VideoSource> open_video(const VideoRequest& request) {
  return std::make_unique<Source>(request);
}

}  // namespace lenticule::player
