// SPDX-License-Identifier: Apache-2.0
// FrameCopier copies frames from a source into scan-out memory ahead of time, in order, over all
// loops.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

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
};

/// FilledQueue is a bounded, lock-free queue. Thread safety: one producer and one consumer.
class FilledQueue {
 public:
  static constexpr size_t kCapacity = 16;

  [[nodiscard]] bool push(FilledFrame frame) noexcept;
  /// Returns the oldest frame; null if empty. Thread safety: the consumer's thread.
  [[nodiscard]] const FilledFrame* peek() const noexcept;
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
              FrameCopierStatistics& statistics, const PlaybackOptions& options);
  /// Returns every buffer to the display. No thread may run the frame copier any more.
  ~FrameCopier();
  FrameCopier(const FrameCopier&) = delete;
  FrameCopier& operator=(const FrameCopier&) = delete;

  /// Filling thread: fills until the sequence is over or request_stop() is called.
  void run() noexcept;
  /// Fills all free buffers. Waits (in real time) for a source that is working, so that simulated
  /// time stands still meanwhile. After `timeout` without a frame the source is not waited for
  /// again until it makes progress.
  /// `until_primed` waits for the source's prefetching, too.
  void pump(std::chrono::milliseconds timeout, bool until_primed = false) noexcept;
  void request_stop() noexcept;
  /// Forgets the buffers of a lost display. No thread may run the frame copier meanwhile.
  void forget_buffers() noexcept;
  /// Fills the newest frame again after forget_buffers(), once the display is back, and returns its
  /// index; without such a frame, returns the index of the next one. run() may be called again
  /// afterwards.
  [[nodiscard]] uint64_t begin_again() noexcept;

  /// Presenter: returns the next filled frame, or null.
  [[nodiscard]] const FilledFrame* peek() const noexcept { return queue_.peek(); }
  /// Presenter: removes that frame from the queue.
  void pop() noexcept { queue_.pop(); }
  /// Presenter: reports that a buffer may be free again.
  void buffer_freed() noexcept { freed_.signal(); }
  /// Presenter: frames before `index` will not be shown and need not be copied.
  void skip_before(uint64_t index) noexcept {
    skip_before_.store(index, std::memory_order_relaxed);
  }
  /// Presenter: frame `index` is displayed.
  void shown(uint64_t index) noexcept { displayed_.store(index, std::memory_order_release); }
  /// Presenter: signals `wake` whenever cut() grows. Call it before any thread runs.
  void wake_at_cuts(WakeFd& wake) noexcept { cut_wake_ = &wake; }
  /// Presenter: asks that `wake` be signalled at the next change. Check the state again after
  /// calling it.
  void wake_at_next_change(WakeFd& wake) noexcept { waiting_.store(&wake); }

  /// Any thread. In Ended and Failed no more frames are pushed; queued frames are still to be
  /// shown.
  [[nodiscard]] State state() const noexcept { return state_.load(); }
  /// Any thread: returns true if as many frames are ready as requested, or as possible.
  [[nodiscard]] bool primed() const noexcept { return primed_.load(); }
  /// Any thread: returns true if, playing forever, the sequence is over and cannot be repeated, but
  /// another one may follow. No frame is due meanwhile.
  [[nodiscard]] bool between_sequences() const noexcept { return between_sequences_.load(); }
  /// Any thread: returns true while the source has no frame due (paused, or between playlist
  /// items); this is not an underrun.
  [[nodiscard]] bool idle() const noexcept { return idle_.load(); }
  /// Any thread: returns the discontinuity number; frames with a smaller one need not be shown.
  [[nodiscard]] uint64_t cut() const noexcept { return cut_.load(); }
  /// Copies the displayed frame into `into`, which must have its size; of a frame for several
  /// panels the picture with the index `part`. Returns false if the frame was not kept or the frame
  /// copier is not running; waits at most `timeout`. Thread safety: any thread except the filling
  /// thread and the presenter's.
  [[nodiscard]] bool copy_shown(frames::WovenFrame& into, size_t part,
                                std::chrono::milliseconds timeout);
  /// Returns the reason for the failure; valid only if state() is Failed.
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 private:
  enum class Step { Worked, NoBuffer, NoFrame, Over };
  struct KeptFrame {
    frames::AcquiredFrame acquired;
    uint64_t index = 0;
  };

  [[nodiscard]] Step step() noexcept;
  [[nodiscard]] Step pull_next();
  [[nodiscard]] Step take(const frames::AcquiredFrame& acquired);
  [[nodiscard]] Step begin_next_loop();
  void fill(display::ScanoutBuffer& buffer, const frames::FrameView& frame) noexcept;
  void keep_or_release(const frames::AcquiredFrame& acquired, bool keep);
  [[nodiscard]] size_t keep_limit() const;
  void release_oldest() noexcept;
  void follow_cut() noexcept;
  void serve_copy() noexcept;
  Step end(State state, const char* failure) noexcept;
  void look_at_source() noexcept;
  void wait_for_change(std::chrono::milliseconds timeout, bool for_buffer) noexcept;
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
  bool timed_out_ = false;
  std::array<KeptFrame, FilledQueue::kCapacity + 2> kept_{};  ///< oldest first
  size_t kept_count_ = 0;
  std::string failure_;

  FilledQueue queue_;
  std::atomic<uint64_t> skip_before_{0};
  std::atomic<uint64_t> displayed_{0};
  std::atomic<uint64_t> cut_{0};
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
