// SPDX-License-Identifier: Apache-2.0
// Copies frames from a source into scan-out memory ahead of time, in order, over all loops.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "base/wake_fd.h"
#include "display/display.h"
#include "frames/frame_source.h"
#include "player/playback/play_statistics.h"

namespace lenticule::player {

/// A scan-out buffer that holds frame `index` of the playback (counted from 0 over all loops).
struct FilledFrame {
  display::ScanoutBuffer* buffer = nullptr;
  uint64_t index = 0;
  uint64_t cut = 0;                  ///< of the source when it was pulled
  uint64_t number = 0;               ///< within its item
  uint32_t item = 0;                 ///< of the source
  std::optional<frames::Rate> rate;  ///< that the source states
};

/// Bounded, lock-free, one producer and one consumer.
class FilledQueue {
 public:
  static constexpr size_t kCapacity = 16;

  [[nodiscard]] bool push(FilledFrame frame) noexcept;
  /// The oldest; null if empty. The consumer's thread.
  [[nodiscard]] const FilledFrame* peek() const noexcept;
  void pop() noexcept;
  [[nodiscard]] size_t size() const noexcept;

 private:
  std::array<FilledFrame, kCapacity> frames_{};
  std::atomic<size_t> pushed_{0};
  std::atomic<size_t> popped_{0};
};

/// A number of loops.
inline constexpr uint64_t kForever = 0;

struct FillerOptions {
  uint64_t loops = 1;  ///< or kForever
  uint64_t prime = 1;  ///< frames that must be ready before playing starts
  /// The newest frame stays lent, by a source that lends two, for a display that is lost and comes
  /// back: begin_again().
  bool keep_newest = false;
  /// Frames stay lent until they leave the glass, as far as the source lends so many: copy_shown().
  bool keep_shown = false;
};

/// The source belongs to the filling thread: run(), or pump() where the presenter fills for itself.
/// The presenter calls what is marked so.
class Filler {
 public:
  enum class State { Running, Ended, Failed };

  Filler(frames::FrameSource& source, display::Display& display, FillerStatistics& statistics,
         FillerOptions options);
  /// Gives every buffer back. Nobody may run it any more.
  ~Filler();
  Filler(const Filler&) = delete;
  Filler& operator=(const Filler&) = delete;

  /// Filling thread: fills until the sequence is over or request_stop() is called.
  void run() noexcept;
  /// Fills all buffers that are free. Waits (in real time) for a source that is at work, so that
  /// simulated time stands still meanwhile; a source that did not move for `patience` is not waited
  /// for again until it does.
  void pump(std::chrono::milliseconds patience) noexcept;
  void request_stop() noexcept;
  /// While nobody runs it: the display is lost and its buffers are void.
  void forget_buffers() noexcept;
  /// After that, with a display that is back: fills the newest frame again, and returns its index;
  /// without one, that of the next. It may be run again then.
  [[nodiscard]] uint64_t begin_again() noexcept;

  /// Presenter: the next filled frame, or null.
  [[nodiscard]] const FilledFrame* peek() const noexcept { return queue_.peek(); }
  /// Presenter: takes it out of the queue.
  void pop() noexcept { queue_.pop(); }
  /// Presenter: a buffer may be free again.
  void buffer_freed() noexcept { freed_.signal(); }
  /// Presenter: frames before `index` will not be shown and need not be copied.
  void skip_before(uint64_t index) noexcept {
    skip_before_.store(index, std::memory_order_relaxed);
  }
  /// Presenter: frame `index` is on the glass.
  void shown(uint64_t index) noexcept { on_glass_.store(index, std::memory_order_release); }
  /// Presenter, before anything runs: `wake` is signalled whenever cut() grows.
  void wake_at_cuts(WakeFd& wake) noexcept { cut_wake_ = &wake; }
  /// Presenter: asks that `wake` be signalled at the next change. Look again after calling it.
  void wake_at_next_change(WakeFd& wake) noexcept { waiting_.store(&wake); }

  /// Any thread. Ended and Failed: nothing is pushed any more, what is queued is still to be shown.
  [[nodiscard]] State state() const noexcept { return state_.load(); }
  /// Any thread: as many frames are ready as were asked for, or as there can be.
  [[nodiscard]] bool primed() const noexcept { return primed_.load(); }
  /// Any thread: playing for ever, the sequence is over, cannot be played again, and another one
  /// may come. Nothing is owed meanwhile.
  [[nodiscard]] bool between_sequences() const noexcept { return between_sequences_.load(); }
  /// Any thread: the source has nothing and owes nothing, however long that takes.
  [[nodiscard]] bool idle() const noexcept { return idle_.load(); }
  /// Any thread: frames of a smaller cut need not be shown any more.
  [[nodiscard]] uint64_t cut() const noexcept { return cut_.load(); }
  /// Any thread but the two: copies the frame that is on the glass, which has the size of `into`.
  /// False if it was not kept, or nobody fills at the moment; waits at most `patience`.
  [[nodiscard]] bool copy_shown(frames::WovenFrame& into, std::chrono::milliseconds patience);
  /// Why it failed; only once state() is Failed.
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 private:
  enum class Step { Worked, NoBuffer, NoFrame, Over };
  struct KeptFrame {
    frames::LentFrame lent;
    uint64_t index = 0;
  };

  [[nodiscard]] Step step() noexcept;
  [[nodiscard]] Step pull_next();
  [[nodiscard]] Step take(const frames::LentFrame& lent);
  [[nodiscard]] Step begin_next_loop();
  void fill(display::ScanoutBuffer& buffer, const frames::FrameView& frame) noexcept;
  void keep_or_release(const frames::LentFrame& lent, bool keep);
  [[nodiscard]] size_t keep_limit() const;
  void release_oldest() noexcept;
  void follow_cut() noexcept;
  void serve_copy() noexcept;
  Step end(State state, const char* failure) noexcept;
  void look_at_source() noexcept;
  void wait_for_change(std::chrono::milliseconds timeout, bool for_buffer) noexcept;
  void notify_presenter() noexcept;

  frames::FrameSource& source_;
  display::Display& display_;
  FillerStatistics& statistics_;
  const FillerOptions options_;

  // Filling thread only.
  display::ScanoutBuffer* buffer_ = nullptr;  ///< acquired, not filled yet
  uint64_t next_index_ = 0;
  uint64_t frames_this_loop_ = 0;
  bool patience_lost_ = false;
  std::array<KeptFrame, FilledQueue::kCapacity + 2> kept_{};  ///< oldest first
  size_t kept_count_ = 0;
  std::string failure_;

  FilledQueue queue_;
  std::atomic<uint64_t> skip_before_{0};
  std::atomic<uint64_t> on_glass_{0};
  std::atomic<uint64_t> cut_{0};
  std::atomic<bool> idle_{false};
  WakeFd* cut_wake_ = nullptr;
  std::atomic<State> state_{State::Running};
  std::atomic<bool> primed_{false};
  std::atomic<bool> between_sequences_{false};
  std::atomic<bool> stopping_{false};
  std::atomic<WakeFd*> waiting_{nullptr};
  WakeFd freed_;

  // Whoever wants a copy of what is on the glass; the filling thread looks only if it is wanted.
  std::atomic<bool> copy_wanted_{false};
  std::mutex copy_mutex_;  ///< guards what follows
  std::condition_variable copy_over_;
  frames::WovenFrame* copy_into_ = nullptr;
  bool copied_ = false;
};

}  // namespace lenticule::player
