// SPDX-License-Identifier: Apache-2.0
// WeavingPipeline weaves views into a rig's woven frames; WeavingSource does that during playback.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "frames/views_input/view_input.h"
#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "player/sources/capture_source.h"
#include "player/sources/live_rig.h"
#include "player/sources/pictures.h"

namespace lenticule::player {

/// The flags of play, weave and convert that state how views are woven.
struct WeavingFlags {
  std::string filter;  ///< empty: the choice of frames::view_filter()
  std::string fit = "contain";
  std::string crosstalk;
};

/// Returns the weave options. Throws Error(Usage) for unknown values.
[[nodiscard]] inline frames::WeaveOptions weave_options(const WeavingFlags& flags) {
  frames::WeaveOptions options{.fit = frames::parse_picture_fit(flags.fit)};
  if (!flags.filter.empty()) options.filter = frames::parse_view_filter(flags.filter);
  return options;
}

/// Parses the value of --crosstalk: empty, "spot", or a percentage. Throws Error(Usage).
[[nodiscard]] inline std::optional<frames::Crosstalk> crosstalk_of(const std::string& text,
                                                                   const optics::Rig& rig,
                                                                   int views) {
  if (text.empty()) return std::nullopt;
  if (text == "spot") return frames::crosstalk_of_spot(rig.sheet.spot_sigma.value * views);
  const auto percent = number_from<double>(text);
  if (!percent)
    throw usage_error("--crosstalk '{}': not a percentage", text)
        .remedy("for example --crosstalk 12, or --crosstalk spot");
  return frames::crosstalk_of_percent(*percent);
}

/// Holds the plan, the threads and the crosstalk compensation. Thread safety: one caller at a time.
class WeavingPipeline {
 public:
  /// Makes the plan, which takes a fraction of a second for a 4K panel. Throws Error(Usage) for
  /// more views than a plan can hold and for invalid flags.
  WeavingPipeline(const optics::Rig& rig, const frames::ViewShape& shape, const WeavingFlags& flags,
                  int threads)
      : weaver_(std::make_shared<const frames::WeavePlan>(optics::OpticalModel(rig), shape,
                                                          weave_options(flags), threads),
                threads),
        crosstalk_(crosstalk_of(flags.crosstalk, rig, shape.count)) {}

  /// Weaves views of that shape into a frame of the panel's size. Throws only with crosstalk
  /// compensation: Error(Usage) for too many views, std::bad_alloc.
  void weave(const frames::ViewSet& views, frames::WovenFrame& frame) {
    if (crosstalk_)
      weaver_.weave(frames::compensate(views, *crosstalk_), frame);
    else
      weaver_.weave(views, frame);
  }

 private:
  frames::FastWeaver weaver_;
  std::optional<frames::Crosstalk> crosstalk_;
};

struct WeavingSourceOptions {
  std::string name = {};                   ///< name in messages
  std::shared_ptr<LiveRig> rig = nullptr;  ///< must not be null
  WeavingFlags weaving = {};
  int threads = 1;
  int pool_frames = 8;  ///< woven frames kept ready, at least 3
  /// Weaves on into the next round, so that rewind() is immediate.
  bool plays_again = true;
  /// Statistics of pictures that come in live, whose newest frame replaces older ones; null for
  /// other inputs.
  std::shared_ptr<CaptureStatistics> live = nullptr;
  /// The views are those of a renderer, which may be replaced by another one.
  bool from_renderer = false;
};

/// WeavingSource weaves views from any input during playback. When the rig file or its trim
/// changes, it makes a new plan in the background and uses the old one until the new one is ready.
/// An input with one frame is a still and is woven again when the plan changes. Thread safety: the
/// player's calls come from one thread; they take a lock that is never held during work.
class WeavingSource final : public frames::FrameSource {
 public:
  /// Weaves a still's first frame. Throws Error(Input) for the rig and for a still that is missing
  /// or broken, Error(Usage) for more views than a plan can hold.
  WeavingSource(std::unique_ptr<frames::ViewInput> input, const WeavingSourceOptions& options)
      : options_(options),
        input_(std::move(input)),
        still_(input_->frame_count() == uint64_t{1}),
        rate_(still_ ? std::optional(kStillRate) : input_->rate()),
        slots_(static_cast<size_t>(std::max(options.pool_frames, kFewestSlots))),
        count_(input_->frame_count()) {
    options_.rig->look();
    rig_version_ = options_.rig->version();
    const optics::Rig rig = options_.rig->rig();
    geometry_ = {.width = rig.panel.width_px, .height = rig.panel.height_px};
    pipeline_ = pipeline_for(rig);
    plans_ = 1;
    for (Slot& slot : slots_) slot.frame = frames::WovenFrame(geometry_);
    if (still_) weave_first_still();
    worker_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
    watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
  }
  /// Waits for the frame or plan in progress.
  ~WeavingSource() override {
    const std::lock_guard lock(mutex_);
    watcher_.request_stop();
    worker_.request_stop();
    changed_.notify_all();
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return geometry_; }
  /// Returns the rate; a still is pulled four times a second.
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return rate_; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override {
    const std::lock_guard lock(mutex_);
    return count_;
  }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    const std::lock_guard lock(mutex_);
    if (!round_ends_.empty() && next_pull_ == round_ends_.front() && failure_.empty())
      return PullStatus::End;
    Slot* const slot = ready_slot(next_pull_);
    if (slot == nullptr) return failure_.empty() ? PullStatus::NotYet : PullStatus::Failed;
    if (!still_) slot->state = SlotState::Acquired;
    ++slot->acquired;
    out = {.frame = slot->frame.view(),
           .number = slot->number,
           .token = static_cast<uint64_t>(slot - slots_.data()),
           .captured_ns = slot->captured_ns};
    ++next_pull_;
    return PullStatus::Ready;
  }
  void release(uint64_t token) override {
    {
      const std::lock_guard lock(mutex_);
      LENTICULE_CHECK(token < slots_.size() && slots_[token].acquired > 0);
      Slot& slot = slots_[token];
      if (--slot.acquired == 0 && slot.state != SlotState::Ready) slot.state = SlotState::Free;
    }
    changed_.notify_all();
  }
  /// Returns how many frames may be borrowed. The worker keeps one slot of a sequence; all frames
  /// of a still share a slot.
  [[nodiscard]] int max_acquired() const override {
    return still_ ? 1'000'000 : static_cast<int>(slots_.size()) - 1;
  }
  [[nodiscard]] uint64_t ready_count() const override {
    const std::lock_guard lock(mutex_);
    if (still_) return next_pull_ < round_ends_.front() ? 1 : 0;
    return static_cast<uint64_t>(std::ranges::count_if(
        slots_, [](const Slot& slot) { return slot.state == SlotState::Ready; }));
  }
  [[nodiscard]] bool saturated() const override {
    if (still_ || options_.live) return true;
    const std::lock_guard lock(mutex_);
    if (!failure_.empty() || nothing_to_do_) return true;
    return std::ranges::none_of(slots_, [](const Slot& slot) {
      return slot.state == SlotState::Free || slot.state == SlotState::Weaving;
    });
  }
  [[nodiscard]] bool rewind() override {
    {
      const std::lock_guard lock(mutex_);
      const bool at_end = !round_ends_.empty() && next_pull_ == round_ends_.front();
      if (!at_end) return next_pull_ == round_begin_;
      round_begin_ = round_ends_.front();
      round_ends_.pop_front();
      if (still_) round_ends_.push_back(round_begin_ + 1);
      ++rounds_wanted_;
      nothing_to_do_ = false;
    }
    changed_.notify_all();
    return true;
  }
  [[nodiscard]] int wake_fd() const override { return wake_.fd(); }
  void service() override { wake_.drain(); }
  [[nodiscard]] std::string failure() const override {
    const std::lock_guard lock(mutex_);
    return failure_;
  }
  [[nodiscard]] bool nothing_due() const override { return between_renderers_.load(); }
  [[nodiscard]] bool waits_for_others() const override {
    return options_.live != nullptr || options_.from_renderer;
  }
  [[nodiscard]] frames::FrameDamage damage() const override { return input_->damage(); }
  [[nodiscard]] std::string video_decoder() const override { return input_->video_decoder(); }

  /// Returns the number of plans made so far.
  [[nodiscard]] uint64_t plans() const { return plans_.load(); }

 private:
  using PullStatus = frames::PullStatus;

  /// Interval at which the trim is checked.
  static constexpr std::chrono::milliseconds kLook{100};

  static constexpr frames::Rate kStillRate{4, 1};
  static constexpr int kFewestSlots = 3;
  /// A ticket counts frames through all rounds. A still has one frame, which is woven into another
  /// slot when its plan changes.
  enum class SlotState { Free, Weaving, Ready, Acquired, Stale };
  struct Slot {
    SlotState state = SlotState::Free;
    uint64_t ticket = 0;
    uint64_t number = 0;
    int64_t captured_ns = 0;
    int acquired = 0;
    frames::WovenFrame frame;
  };
  void weave_first_still() {
    await_first(*input_, options_.name);
    Slot& first = slots_.front();
    pipeline_->weave(input_->views(), first.frame);
    first.state = SlotState::Ready;
    round_ends_ = {1};
  }
  [[nodiscard]] std::shared_ptr<WeavingPipeline> pipeline_for(const optics::Rig& rig) const {
    return std::make_shared<WeavingPipeline>(rig, input_->shape(), options_.weaving,
                                             options_.threads);
  }
  /// Makes new plans beside the weaving, with as many threads: a plan is small work for a few of
  /// them.
  void watch(const std::stop_token& stop) noexcept {
    while (true) {
      {
        std::unique_lock lock(mutex_);
        if (changed_.wait_for(lock, kLook, [&] { return stop.stop_requested(); })) return;
      }
      try {
        look_at_rig();
      } catch (const std::exception& error) {
        say("{}: still woven for the previous rig: {}\n", options_.rig->file().string(),
            error.what());
      }
    }
  }
  void look_at_rig() {
    LiveRig& rig = *options_.rig;
    rig.look();
    const uint64_t version = rig.version();
    if (version == rig_version_) return;
    rig_version_ = version;
    std::shared_ptr<WeavingPipeline> pipeline = pipeline_for(rig.rig());
    {
      const std::lock_guard lock(mutex_);
      pipeline_.swap(pipeline);
      ++plans_;
    }
    changed_.notify_all();
  }
  void work(const std::stop_token& stop) noexcept {
    std::shared_ptr<WeavingPipeline> used = newest_pipeline();
    while (true) {
      {
        const std::lock_guard lock(mutex_);
        if (stop.stop_requested() || !failure_.empty()) return;
      }
      try {
        const bool done = still_ ? weave_still(used) : weave_next();
        if (!done) wait_a_moment(stop);
        if (!done && options_.from_renderer)
          input_->wait(std::chrono::milliseconds(0));  // serves it
      } catch (const std::exception& error) {
        fail(error.what());
      }
    }
  }
  [[nodiscard]] std::shared_ptr<WeavingPipeline> newest_pipeline() {
    const std::lock_guard lock(mutex_);
    return pipeline_;
  }
  /// Returns false if there is nothing to do.
  bool weave_still(std::shared_ptr<WeavingPipeline>& used) {
    const std::shared_ptr<WeavingPipeline> newest = newest_pipeline();
    if (newest == used) return false;
    Slot* const slot = free_slot();
    if (slot == nullptr) return false;
    newest->weave(input_->views(), slot->frame);
    publish_still(*slot);
    used = newest;
    return true;
  }
  /// Returns false if no slot is free, or the next round is not requested yet.
  bool weave_next() {
    if (at_end_) {
      {
        const std::lock_guard lock(mutex_);
        nothing_to_do_ = !options_.plays_again && rounds_wanted_ <= rounds_woven_;
        if (nothing_to_do_) return false;
      }
      if (!input_->rewind()) throw failed_error("{}: cannot be restarted", options_.name);
      at_end_ = false;
    }
    Slot* const slot = free_slot();
    if (slot == nullptr) return false;
    PullStatus status = PullStatus::Failed;
    try {
      status = input_->next();
      if (status == PullStatus::Ready) fill(*slot);
    } catch (...) {
      give_back(*slot);
      throw;
    }
    if (status == PullStatus::Ready) {
      publish(*slot);
      input_->release();
      return true;
    }
    give_back(*slot);
    if (status == PullStatus::Failed) fail(input_->failure());
    // The next renderer of a ring continues.
    const bool goes_on =
        status == PullStatus::End && options_.from_renderer && options_.plays_again;
    if (goes_on) {
      between_renderers_.store(true);
      input_->go_on();
    }
    if (status == PullStatus::End && !goes_on) finish_round();
    if (status == PullStatus::NotYet || goes_on) input_->wait(kLook);
    return true;
  }
  /// Weaves the views. A repeated frame is copied if the rig is the same.
  void fill(Slot& slot) {
    const auto pipeline = newest_pipeline();
    const auto begin = std::chrono::steady_clock::now();
    if (input_->repeats() && woven_last_ != nullptr && woven_by_ == pipeline) {
      if (woven_last_ != &slot)
        std::ranges::copy(woven_last_->frame.bytes(), slot.frame.bytes().begin());
    } else {
      pipeline->weave(input_->views(), slot.frame);
    }
    if (options_.live) options_.live->weaving.record(std::chrono::steady_clock::now() - begin);
    woven_last_ = &slot;
    woven_by_ = pipeline;
  }
  void finish_round() {
    {
      const std::lock_guard lock(mutex_);
      at_end_ = true;
      ++rounds_woven_;
      const bool empty = next_weave_ == (round_ends_.empty() ? round_begin_ : round_ends_.back());
      if (empty) failure_ = options_.name + ": has no frames";
      round_ends_.push_back(next_weave_);
      if (!count_) count_ = next_weave_ - round_begin_;
    }
    wake_.signal();
  }
  [[nodiscard]] Slot* free_slot() {
    const std::lock_guard lock(mutex_);
    for (Slot& slot : slots_) {
      if (slot.state != SlotState::Free) continue;
      slot.state = SlotState::Weaving;
      return &slot;
    }
    return nullptr;
  }
  void give_back(Slot& slot) {
    const std::lock_guard lock(mutex_);
    slot.state = SlotState::Free;
  }
  [[nodiscard]] Slot* ready_slot(uint64_t ticket) {
    for (Slot& slot : slots_)
      if (slot.state == SlotState::Ready && (still_ || slot.ticket == ticket)) return &slot;
    return nullptr;
  }
  /// Publishes a still. The previous slot becomes free when its last frame is released.
  void publish_still(Slot& slot) {
    const std::lock_guard lock(mutex_);
    for (Slot& other : slots_)
      if (other.state == SlotState::Ready)
        other.state = other.acquired > 0 ? SlotState::Stale : SlotState::Free;
    slot.state = SlotState::Ready;
  }
  void publish(Slot& slot) {
    between_renderers_.store(false);
    {
      const std::lock_guard lock(mutex_);
      if (options_.live) supersede();
      slot.state = SlotState::Ready;
      slot.ticket = next_weave_++;
      slot.number = input_->number();
      slot.captured_ns = input_->captured_ns();
    }
    wake_.signal();
  }
  /// Frees the frames that a newer live one replaces. The caller holds the mutex.
  void supersede() {
    for (Slot& slot : slots_) {
      if (slot.state != SlotState::Ready) continue;
      slot.state = SlotState::Free;
      options_.live->woven_superseded.add();
    }
    next_pull_ = next_weave_;
  }
  void fail(const std::string& why) {
    {
      const std::lock_guard lock(mutex_);
      failure_ = why;
    }
    wake_.signal();
  }
  void wait_a_moment(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    if (!stop.stop_requested()) changed_.wait_for(lock, kLook);
  }

  const WeavingSourceOptions options_;
  const std::unique_ptr<frames::ViewInput> input_;  ///< used by the worker thread
  const bool still_;
  frames::FrameGeometry geometry_;
  const std::optional<frames::Rate> rate_;
  uint64_t rig_version_ = 0;  ///< rig version of the newest plan; used by the watcher thread
  WakeFd wake_;
  std::atomic<uint64_t> plans_{0};
  std::atomic<bool> between_renderers_{false};  ///< the last one said goodbye
  bool at_end_ = false;  ///< the input is at its end and not rewound; used by the worker thread
  const Slot* woven_last_ = nullptr;  ///< slot filled last; used by the worker thread
  std::shared_ptr<const WeavingPipeline> woven_by_;  ///< used by the worker thread

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  std::shared_ptr<WeavingPipeline> pipeline_;
  std::optional<uint64_t> count_;    ///< frames in a round, if known
  uint64_t next_weave_ = 0;          ///< ticket
  uint64_t next_pull_ = 0;           ///< ticket
  uint64_t round_begin_ = 0;         ///< first ticket of this round
  std::deque<uint64_t> round_ends_;  ///< tickets before which pull() stops until rewind()
  uint64_t rounds_wanted_ = 1;
  uint64_t rounds_woven_ = 0;
  bool nothing_to_do_ = false;  ///< the input is over, and no other round is requested
  std::string failure_;

  std::jthread watcher_, worker_;  // last members: the threads use everything above
};

}  // namespace lenticule::player
