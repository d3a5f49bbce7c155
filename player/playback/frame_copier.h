// SPDX-License-Identifier: Apache-2.0
// FrameCopier copies frames from a source into scan-out memory ahead of time, in order, over all
// loops.
#pragma once

#include <poll.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/unique_fd.h"
#include "display/display.h"
#include "frames/frame_source.h"
#include "player/playback/playback_options.h"

namespace lenticule::player {

/// A scan-out buffer that holds frame `index` of the playback (counted from 0 over all loops).
struct FilledFrame {
  display::ScanoutBuffer* buffer = nullptr;
  uint64_t index = 0;
  uint64_t cut = 0;     ///< discontinuity number of the source when the frame was pulled
  uint64_t number = 0;  ///< number within its item
  uint32_t item = 0;    ///< item number that the source gives
  std::optional<frames::Rate> rate;  ///< rate that the source states
  int64_t captured_ns = 0;           ///< as AcquiredFrame::captured_ns
};

/// FilledQueue is a bounded, lock-free queue. Thread safety: one producer and one consumer.
class FilledQueue {
 public:
  static constexpr size_t kCapacity = 16;

  [[nodiscard]] bool push(FilledFrame frame) noexcept {
    const size_t pushed = pushed_.load(std::memory_order_relaxed);
    if (pushed - popped_.load(std::memory_order_acquire) == kCapacity) return false;
    frames_[pushed % kCapacity] = frame;
    pushed_.store(pushed + 1);  // sequentially consistent with FrameCopier::waiting_
    return true;
  }
  /// Returns the oldest frame; null if empty. Thread safety: the consumer's thread.
  [[nodiscard]] const FilledFrame* peek() const noexcept {
    const size_t popped = popped_.load(std::memory_order_relaxed);
    return pushed_.load() == popped ? nullptr : &frames_[popped % kCapacity];
  }
  void pop() noexcept {
    popped_.store(popped_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }
  [[nodiscard]] size_t size() const noexcept {
    return pushed_.load(std::memory_order_acquire) - popped_.load(std::memory_order_acquire);
  }

 private:
  std::array<FilledFrame, kCapacity> frames_{};
  std::atomic<size_t> pushed_{0};
  std::atomic<size_t> popped_{0};
};

/// Thread safety: the source belongs to the filling thread, which is the thread of run(), or the
/// presenter's if the presenter calls pump(). The presenter calls the functions marked "Presenter".
class FrameCopier {
 public:
  enum class State { Running, Ended, Failed };

  /// Lifetime: all arguments must outlive the frame copier.
  FrameCopier(frames::FrameSource& source, display::Display& display,
              FrameCopierStatistics& statistics, const PlaybackOptions& options)
      : source_(source), display_(display), statistics_(statistics), options_(options) {}
  /// Returns every buffer to the display. No thread may run the frame copier any more.
  ~FrameCopier() {
    if (buffer_ != nullptr) display_.discard(buffer_);
    for (; queue_.peek() != nullptr; queue_.pop()) display_.discard(queue_.peek()->buffer);
    while (kept_count_ > 0) release_oldest();
  }

  /// Filling thread: fills until the sequence is over or request_stop() is called.
  void run() noexcept {
    Step result = Step::Worked;
    while (result != Step::Over && !stopping_.load(std::memory_order_acquire)) {
      const auto now = SteadyClock::now().time_since_epoch();
      statistics_.turn_ns.set(static_cast<uint64_t>(std::chrono::nanoseconds(now).count()));
      result = step();
      if (result != Step::Worked && result != Step::Over)
        wait_for_change(kNap, result == Step::NoBuffer);
    }
    statistics_.turn_ns.set(0);
  }
  /// Fills all free buffers. Waits (in real time) for a source that is working, so that simulated
  /// time stands still meanwhile. After `timeout` without a frame the source is not waited for
  /// again until it makes progress.
  /// `until_primed` waits for the source's prefetching, too.
  void pump(std::chrono::milliseconds timeout, bool until_primed = false) noexcept {
    const auto deadline = SteadyClock::now() + timeout;
    if (source_.wake_fd() >= 0) source_.service();
    while (!stopping_.load(std::memory_order_acquire)) {
      const Step result = step();
      if (result == Step::Worked) timed_out_ = false;
      const bool filled = result == Step::NoBuffer && (!until_primed || primed());
      if (filled || result == Step::Over) return;
      if (result == Step::Worked) continue;
      if (timed_out_ || source_.wake_fd() < 0) return;
      wait_for_change(kNap, false);
      timed_out_ = SteadyClock::now() >= deadline;
    }
  }
  void request_stop() noexcept {
    stopping_.store(true, std::memory_order_release);
    freed_.signal();
    copy_over_.notify_all();
  }
  /// Forgets the buffers of a lost display. No thread may run the frame copier meanwhile.
  void forget_buffers() noexcept {
    buffer_ = nullptr;
    while (queue_.peek() != nullptr) queue_.pop();
  }
  /// Fills the newest frame again after forget_buffers(), once the display is back, and returns its
  /// index; without such a frame, returns the index of the next one. run() may be called again
  /// afterwards.
  [[nodiscard]] uint64_t begin_again() noexcept {
    stopping_.store(false, std::memory_order_release);
    timed_out_ = false;
    if (kept_count_ == 0) {
      skip_before(next_index_);
      return next_index_;
    }
    const KeptFrame& newest = kept_.at(kept_count_ - 1);
    skip_before(newest.index);
    display::ScanoutBuffer* const buffer = display_.acquire();
    if (buffer == nullptr) return next_index_;
    fill(*buffer, newest.acquired);
    push(buffer, newest.acquired, newest.index);
    return newest.index;
  }

  /// Returns the next filled frame, or null. Thread safety: presenter only.
  [[nodiscard]] const FilledFrame* peek() const noexcept { return queue_.peek(); }
  /// Returns the number of filled frames. Thread safety: presenter only.
  [[nodiscard]] size_t filled() const noexcept { return queue_.size(); }
  /// Removes that frame from the queue. Thread safety: presenter only.
  void pop() noexcept { queue_.pop(); }
  /// Reports that a buffer may be free again. Thread safety: presenter only.
  void buffer_freed() noexcept { freed_.signal(); }
  /// Allows skipping the frames before `index`: they will not be shown. Thread safety: presenter
  /// only.
  void skip_before(uint64_t index) noexcept {
    skip_before_.store(index, std::memory_order_relaxed);
  }
  /// Reports that frame `index` is displayed. Thread safety: presenter only.
  void shown(uint64_t index) noexcept { displayed_.store(index, std::memory_order_release); }
  /// Signals `wake` whenever cut() grows. Call it before any thread runs. Thread safety: presenter
  /// only.
  void wake_at_cuts(WakeFd& wake) noexcept { cut_wake_ = &wake; }
  /// Asks that `wake` be signalled at the next change. Check the state again after calling it.
  /// Thread safety: presenter only.
  void wake_at_next_change(WakeFd& wake) noexcept { waiting_.store(&wake); }

  /// Returns the state. In Ended and Failed no more frames are pushed; queued frames are still to
  /// be shown. Thread safety: any thread.
  [[nodiscard]] State state() const noexcept { return state_.load(); }
  /// Returns true if as many frames are ready as requested, or as possible. Thread safety: any
  /// thread.
  [[nodiscard]] bool primed() const noexcept { return primed_.load(); }
  /// Returns true if, playing forever, the sequence is over and cannot be repeated, but another one
  /// may follow. No frame is due meanwhile. Thread safety: any thread.
  [[nodiscard]] bool between_sequences() const noexcept { return between_sequences_.load(); }
  /// Returns true while the source has no frame due (paused, or between playlist items); this is
  /// not an underrun. Thread safety: any thread.
  [[nodiscard]] bool idle() const noexcept { return idle_.load(); }
  /// Returns the discontinuity number; frames with a smaller one need not be shown. Thread safety:
  /// any thread.
  [[nodiscard]] uint64_t cut() const noexcept { return source_.cut(); }
  /// Copies the displayed frame into `into`, which must have its size; of a frame for several
  /// panels the picture with the index `part`. Returns false if the frame was not kept or the frame
  /// copier is not running; waits at most `timeout`. Thread safety: any thread except the filling
  /// thread and the presenter's.
  [[nodiscard]] bool copy_shown(frames::WovenFrame& into, size_t part,
                                std::chrono::milliseconds timeout) {
    std::unique_lock lock(copy_mutex_);
    copy_into_ = &into;
    copied_part_ = part;
    copied_ = false;
    copy_wanted_.store(true, std::memory_order_release);
    freed_.signal();
    copy_over_.wait_for(lock, timeout, [this] {
      return copy_into_ == nullptr || stopping_.load(std::memory_order_acquire);
    });
    copy_into_ = nullptr;
    copy_wanted_.store(false, std::memory_order_release);
    return copied_;
  }
  /// Returns the reason for the failure; valid only if state() is Failed.
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 private:
  using milliseconds = std::chrono::milliseconds;
  using SteadyClock = std::chrono::steady_clock;
  /// Longest sleep. It bounds the delay until a change is noticed that signals no descriptor.
  static constexpr milliseconds kNap{50};
  static constexpr milliseconds kNapWithoutDescriptor{2};

  enum class Step { Worked, NoBuffer, NoFrame, Over };
  struct KeptFrame {
    frames::AcquiredFrame acquired;
    uint64_t index = 0;
  };

  [[nodiscard]] Step step() noexcept {
    if (copy_wanted_.load(std::memory_order_acquire)) serve_copy();
    if (state() != State::Running) return Step::Over;
    try {
      follow_cut();
      const Step result = pull_next();
      look_at_source();
      return result;
    } catch (const std::exception& error) {
      return end(State::Failed, error.what());
    }
  }
  [[nodiscard]] Step pull_next() {
    const bool wanted = next_index_ >= skip_before_.load(std::memory_order_relaxed);
    if (wanted && buffer_ == nullptr) buffer_ = display_.acquire();
    if (wanted && buffer_ == nullptr) return Step::NoBuffer;

    frames::AcquiredFrame acquired;
    switch (source_.pull(acquired)) {
      case frames::PullStatus::Ready:
        return take(acquired);
      case frames::PullStatus::NotYet:
        idle_.store(source_.nothing_due());
        statistics_.waits_for_others.set(source_.waits_for_others() ? 1 : 0);
        return Step::NoFrame;
      case frames::PullStatus::End:
        return begin_next_loop();
      case frames::PullStatus::Failed:
        break;
    }
    return end(State::Failed, source_.failure().c_str());
  }
  [[nodiscard]] Step take(const frames::AcquiredFrame& acquired) {
    const bool fits = acquired.frame.geometry == display_.mode().geometry;
    const bool wanted = buffer_ != nullptr;
    if (fits && wanted) fill(*buffer_, acquired);
    keep_or_release(acquired, fits && wanted);
    if (!fits) return end(State::Failed, "the source changed the size of its frames");

    idle_.store(false);
    between_sequences_.store(false);
    const uint64_t index = next_index_++;
    ++frames_this_loop_;
    statistics_.sample_ready(source_.ready_count());
    if (!wanted) {
      statistics_.released.add();
      return Step::Worked;
    }
    push(std::exchange(buffer_, nullptr), acquired, index);
    notify_presenter();
    return Step::Worked;
  }
  void push(display::ScanoutBuffer* buffer, const frames::AcquiredFrame& acquired, uint64_t index) {
    LENTICULE_CHECK(queue_.push({.buffer = buffer,
                                 .index = index,
                                 .cut = cut(),
                                 .number = acquired.number,
                                 .item = acquired.item,
                                 .rate = source_.rate(),
                                 .captured_ns = acquired.captured_ns}));
  }
  [[nodiscard]] Step begin_next_loop() {
    if (between_sequences_.load()) return Step::NoFrame;
    if (std::exchange(frames_this_loop_, 0) == 0) {
      // A source that can be repeated would be empty again; a ring waits for the next renderer.
      const bool another_may_come = options_.loops == kForever && !source_.rewind();
      if (!another_may_come) return end(State::Failed, "the sequence contains no frame");
    } else {
      statistics_.loops.add();
      if (statistics_.loops.get() == options_.loops) return end(State::Ended, "");
      if (source_.rewind()) return Step::Worked;
      if (options_.loops != kForever) return end(State::Failed, "the sequence cannot be repeated");
    }
    between_sequences_.store(true);
    notify_presenter();
    return Step::NoFrame;
  }
  void fill(display::ScanoutBuffer& buffer, const frames::AcquiredFrame& acquired) noexcept {
    const auto begin = SteadyClock::now();
    buffer.fill(acquired.frame);
    const std::span<const OverlayBox> boxes = boxes_over(acquired);
    for (const OverlayBox& box : boxes) buffer.fill_box(box.pixels, box.left, box.top, box.part);
    statistics_.overlaid.add(boxes.empty() ? 0 : 1);
    statistics_.copy.record(SteadyClock::now() - begin);
    statistics_.filled.add();
  }
  [[nodiscard]] std::span<const OverlayBox> boxes_over(
      const frames::AcquiredFrame& acquired) const {
    return options_.overlays ? options_.overlays(acquired) : std::span<const OverlayBox>();
  }
  /// Keeps or releases the frame whose index is next_index_.
  void keep_or_release(const frames::AcquiredFrame& acquired, bool keep) {
    const size_t limit = keep ? keep_limit() : 0;
    const uint64_t displayed = displayed_.load(std::memory_order_acquire);
    const auto is_over = [&] {
      return options_.control != nullptr && kept_.front().index < displayed;
    };
    if (keep)
      while (kept_count_ > 0 && (kept_count_ >= limit || is_over())) release_oldest();
    if (limit == 0) return source_.release(acquired.token);
    kept_.at(kept_count_++) = {.acquired = acquired, .index = next_index_};
  }
  /// Returns how many frames may be kept. One of the frames that the source lends is reserved for
  /// the next pull.
  [[nodiscard]] size_t keep_limit() const {
    const auto spare = static_cast<size_t>(std::max(0, source_.max_acquired() - 1));
    if (options_.control != nullptr) return std::min(spare, kept_.size());
    return options_.reconnect ? std::min<size_t>(spare, 1) : 0;
  }
  void release_oldest() noexcept {
    source_.release(kept_.front().acquired.token);
    std::move(kept_.begin() + 1, kept_.begin() + static_cast<ptrdiff_t>(kept_count_),
              kept_.begin());
    --kept_count_;
  }
  void follow_cut() noexcept {
    const bool is_new = std::exchange(noticed_cut_, cut()) != cut();
    if (is_new && cut_wake_ != nullptr) cut_wake_->signal();
  }
  void serve_copy() noexcept {
    {
      const std::lock_guard lock(copy_mutex_);
      const uint64_t displayed = displayed_.load(std::memory_order_acquire);
      for (size_t k = 0; k < kept_count_ && copy_into_ != nullptr; ++k) {
        if (kept_.at(k).index != displayed) continue;
        const frames::FrameView& all = kept_.at(k).acquired.frame;
        const bool has_part = copied_part_ < std::max<size_t>(all.parts.size(), 1);
        if (!has_part) continue;
        const frames::FrameView& frame = all.parts.empty() ? all : all.parts[copied_part_];
        if (frame.geometry != copy_into_->geometry()) continue;
        std::copy(frame.bytes.begin(), frame.bytes.end(), copy_into_->bytes().begin());
        for (const OverlayBox& box : boxes_over(kept_.at(k).acquired))
          if (box.part == copied_part_) box.copy_into(copy_into_->bytes(), frame.geometry);
        copied_ = true;
      }
      copy_into_ = nullptr;
      copy_wanted_.store(false, std::memory_order_release);
    }
    copy_over_.notify_all();
  }
  Step end(State state, const char* failure) noexcept {
    failure_ = failure;
    state_.store(state);
    primed_.store(true);
    notify_presenter();
    return Step::Over;
  }
  void look_at_source() noexcept {
    if (state() != State::Running) return;
    const bool primed =
        queue_.size() + source_.ready_count() >= options_.prime || source_.saturated();
    if (primed == primed_.load(std::memory_order_relaxed)) return;
    primed_.store(primed);
    notify_presenter();
  }
  void wait_for_change(std::chrono::milliseconds timeout, bool for_buffer) noexcept {
    const int source_fd = source_.wake_fd();
    const bool blind = source_fd < 0 && !for_buffer;
    pollfd entries[2] = {{.fd = freed_.fd(), .events = POLLIN, .revents = 0},
                         {.fd = source_fd, .events = POLLIN, .revents = 0}};
    const milliseconds nap = blind ? kNapWithoutDescriptor : timeout;
    (void)poll(entries, 2, static_cast<int>(nap.count()));
    freed_.drain();
    if (source_fd >= 0) source_.service();
  }
  void notify_presenter() noexcept {
    if (WakeFd* const wake = waiting_.exchange(nullptr)) wake->signal();
  }

  frames::FrameSource& source_;
  display::Display& display_;
  FrameCopierStatistics& statistics_;
  const PlaybackOptions& options_;

  // Filling thread only.
  display::ScanoutBuffer* buffer_ = nullptr;  ///< acquired and not filled yet
  uint64_t next_index_ = 0;
  uint64_t frames_this_loop_ = 0;
  uint64_t noticed_cut_ = 0;
  bool timed_out_ = false;
  std::array<KeptFrame, FilledQueue::kCapacity + 2> kept_{};  ///< oldest first
  size_t kept_count_ = 0;
  std::string failure_;

  FilledQueue queue_;
  std::atomic<uint64_t> skip_before_{0};
  std::atomic<uint64_t> displayed_{0};
  std::atomic<bool> idle_{false};
  WakeFd* cut_wake_ = nullptr;
  std::atomic<State> state_{State::Running};
  std::atomic<bool> primed_{false};
  std::atomic<bool> between_sequences_{false};
  std::atomic<bool> stopping_{false};
  std::atomic<WakeFd*> waiting_{nullptr};
  WakeFd freed_;

  // Requests to copy the displayed frame; the atomic flag spares the filling thread the mutex.
  std::atomic<bool> copy_wanted_{false};
  std::mutex copy_mutex_;  ///< guards the members below
  std::condition_variable copy_over_;
  frames::WovenFrame* copy_into_ = nullptr;
  size_t copied_part_ = 0;
  bool copied_ = false;
};

}  // namespace lenticule::player
