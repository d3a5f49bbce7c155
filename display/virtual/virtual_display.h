// SPDX-License-Identifier: Apache-2.0
// Opens a display without hardware: it has its own vblank clock and scan-out buffers in ordinary
// memory.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/large_memory.h"
#include "base/owned.h"
#include "display/clock.h"
#include "display/display.h"
#include "display/scanout_format.h"
#include "display/scanout_recorder.h"

namespace lenticule::display {

/// Returns the delay of a vblank's event. Called once per event, on the presenter thread.
using EventDelay = std::function<Nanoseconds(uint64_t sequence)>;

/// Returns delays of 0 ... `most`, uniformly; the same for a seed, in any order of requests.
inline EventDelay uniform_jitter(Nanoseconds most, uint64_t seed) {
  return [choices = static_cast<uint64_t>(most.count()) + 1, seed](uint64_t sequence) {
    std::seed_seq seeds{seed >> 32, seed, sequence >> 32, sequence};
    return Nanoseconds(static_cast<int64_t>(std::mt19937_64(seeds)() % choices));
  };
}

struct VirtualDisplayOptions {
  frames::FrameGeometry geometry = {};  ///< scan-out memory; its frames may be turned
  optics::Mounting mounting = {};
  ScanoutDepth depth = ScanoutDepth::Bits8;
  std::vector<ScanoutPart> parts = {};  ///< the panels of a wall; empty for one panel
  frames::Rate refresh{60, 1};
  /// 2 ... 16: one displayed, one pending, the others filled ahead.
  int buffers = 3;
  /// Null = real time.
  std::shared_ptr<Clock> clock = nullptr;
  /// Null = no delay. A delay of more than a period makes the player miss a vblank.
  EventDelay event_delay = nullptr;
  /// Null = no recording. In real time, recording has its own thread and 2 to 64 additional buffers
  /// (64 MiB if that is more than two). A frame that finds all of them busy is counted instead of
  /// recorded, so that recording never disturbs pacing. In simulated time, recording runs inside
  /// wait_event() and skips no frame.
  std::shared_ptr<ScanoutRecorder> recorder = nullptr;
};

enum class BufferState { Free, Acquired, Pending, Displayed };

inline constexpr size_t kCacheLine = 64;

/// Returns the words per row. Rows start on cache lines, so that streaming stores are aligned.
inline size_t stride_words(frames::FrameGeometry geometry) noexcept {
  constexpr size_t kWords = kCacheLine / sizeof(uint32_t);
  return (static_cast<size_t>(geometry.width) + kWords - 1) / kWords * kWords;
}

/// VirtualBuffer is a scan-out buffer in ordinary memory, with the state of its use. A buffer that
/// is being recorded is not free, even in state Free. Thread safety: the filling thread acquires
/// it; the presenter thread makes all other transitions.
class VirtualBuffer final : public ScanoutBuffer {
 public:
  /// Fills the buffer with black, which touches every page, so that page faults cannot delay a
  /// frame.
  explicit VirtualBuffer(const ScanoutLayout& layout)
      : layout_(layout),
        stride_(stride_words(layout.geometry)),
        words_(static_cast<uint32_t*>(std::aligned_alloc(kCacheLine, bytes(layout.geometry)))) {
    if (!words_) throw std::bad_alloc();
    std::memset(words_.get(), 0, bytes(layout.geometry));
  }

  void fill(const frames::FrameView& frame) noexcept override {
    LENTICULE_CHECK(layout_.takes(frame));
    expand_frame(layout_, frame, words_.get(), stride_);
  }
  void fill_box(const frames::FrameView& box, int left, int top, size_t part) noexcept override {
    expand_box(layout_, box, left, top, part, words_.get(), stride_);
  }

  /// Changes Free to Acquired; returns false if the buffer is not free.
  [[nodiscard]] bool try_acquire() noexcept {
    if (state() != BufferState::Free || recording_.load(std::memory_order_acquire)) return false;
    set_state(BufferState::Acquired);
    return true;
  }

  void set_state(BufferState state) noexcept { state_.store(state, std::memory_order_release); }
  [[nodiscard]] BufferState state() const noexcept {
    return state_.load(std::memory_order_acquire);
  }

  void begin_recording() noexcept { recording_.store(true, std::memory_order_relaxed); }
  void end_recording() noexcept { recording_.store(false, std::memory_order_release); }
  [[nodiscard]] ScanoutView view() const noexcept {
    return {words_.get(), stride_, layout_.geometry, layout_.depth};
  }

  /// Returns the bytes of one buffer of this size.
  [[nodiscard]] static size_t bytes(frames::FrameGeometry geometry) noexcept {
    return stride_words(geometry) * static_cast<size_t>(geometry.height) * sizeof(uint32_t);
  }

 private:
  ScanoutLayout layout_;
  size_t stride_;
  Owned<uint32_t, std::free> words_;
  std::atomic<BufferState> state_{BufferState::Free};
  std::atomic<bool> recording_{false};
};

/// RecordingThread passes displayed buffers to a recorder on its own thread, so that the presenter
/// never waits for a disk. Its destructor waits until those in the queue are recorded.
class RecordingThread {
 public:
  /// Holds at most `capacity` buffers at a time, waiting or being recorded.
  RecordingThread(std::shared_ptr<ScanoutRecorder> recorder, size_t capacity)
      : recorder_(std::move(recorder)),
        jobs_(capacity),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  /// Queues a buffer and returns at once. The buffer stays in use until it is recorded. Thread
  /// safety: the presenter thread.
  void offer(ShownFrame shown, VirtualBuffer* buffer) noexcept {
    {
      const std::lock_guard lock(mutex_);
      if (count_ == jobs_.size()) {
        ++skipped_;
        recorder_->count_skipped();
        return;
      }
      shown.skipped_before = std::exchange(skipped_, 0);
      buffer->begin_recording();
      jobs_[(first_ + count_) % jobs_.size()] = {shown, buffer};
      ++count_;
    }
    changed_.notify_one();
  }

 private:
  struct Job {
    ShownFrame shown;
    VirtualBuffer* buffer = nullptr;
  };

  void run(const std::stop_token& stop) noexcept {
    std::unique_lock lock(mutex_);
    while (changed_.wait(lock, stop, [this] { return count_ > 0; })) {
      const Job job = jobs_[first_];
      lock.unlock();
      recorder_->record(job.shown, job.buffer->view());
      job.buffer->end_recording();
      lock.lock();
      // The job is counted until it is done, so that jobs_.size() bounds the buffers taken from the
      // display.
      first_ = (first_ + 1) % jobs_.size();
      --count_;
    }
  }

  std::shared_ptr<ScanoutRecorder> recorder_;
  uint64_t skipped_ = 0;  ///< frames skipped since the last queued one; presenter thread only

  std::mutex mutex_;  ///< guards all members below, for a few instructions at a time
  std::condition_variable_any changed_;
  std::vector<Job> jobs_;  ///< ring buffer of `capacity` jobs
  size_t first_ = 0;
  size_t count_ = 0;

  std::jthread thread_;  // last member: the thread uses everything above
};

inline constexpr int kMinBuffers = 2;
inline constexpr int kMaxBuffers = 16;
inline constexpr int kMaxPixels = 32768;  // per side

inline void check_options(const VirtualDisplayOptions& options) {
  const auto& geometry = options.geometry;
  const auto sane = [](int side) { return side >= 1 && side <= kMaxPixels; };
  if (!sane(geometry.width) || !sane(geometry.height))
    throw usage_error("virtual display {}x{}: size out of range", geometry.width, geometry.height)
        .remedy(fmt::format("each side has 1 to {} pixels", kMaxPixels));
  if (geometry.format != frames::PixelFormat::Rgb8)
    throw Error(ErrorKind::Usage, "virtual display: only 8-bit RGB frames can be shown");
  if (options.buffers < kMinBuffers || options.buffers > kMaxBuffers)
    throw usage_error("virtual display: {} scan-out buffers", options.buffers)
        .remedy(fmt::format("use {} to {}", kMinBuffers, kMaxBuffers));
}

inline void check_memory(const VirtualDisplayOptions& options, int buffers) {
  const uint64_t wanted = VirtualBuffer::bytes(options.geometry) * static_cast<uint64_t>(buffers);
  const uint64_t available = available_memory();
  if (available > 0 && wanted > available / 2)
    throw failed_error(
        "virtual display: {} buffers need {} MiB, more than half of the {} MiB "
        "that are free",
        buffers, wanted >> 20, available >> 20)
        .remedy("use a smaller panel or fewer buffers");
}

/// Returns the number of buffers for recording: more for small panels, whose frames need less
/// memory.
inline int buffers_to_record(frames::FrameGeometry geometry) {
  constexpr size_t kBudget = size_t{64} << 20;
  return static_cast<int>(std::clamp<size_t>(kBudget / VirtualBuffer::bytes(geometry), 2, 64));
}

class VirtualDisplay final : public Display {
 public:
  explicit VirtualDisplay(const VirtualDisplayOptions& options)
      : clock_(options.clock ? options.clock : make_monotonic_clock()),
        timeline_(clock_->now(), options.refresh),
        event_delay_(options.event_delay),
        recorder_(options.recorder),
        buffers_in_use_(options.buffers) {
    mode_ = {
        .geometry = turned(options.geometry, options.mounting),
        .refresh = options.refresh,
        .name = fmt::format("virtual {}x{}@{}{}", options.geometry.width, options.geometry.height,
                            frames::to_string(options.refresh), depth_suffix(options.depth)),
        .hardware_clock = false};
    const bool recording_thread = recorder_ && clock_->real_time();
    const int recorded_at_once = recording_thread ? buffers_to_record(options.geometry) : 0;
    const int buffers = options.buffers + recorded_at_once;
    check_memory(options, buffers);
    for (int i = 0; i < buffers; ++i)
      buffers_.push_back(std::make_unique<VirtualBuffer>(ScanoutLayout{.geometry = options.geometry,
                                                                       .mounting = options.mounting,
                                                                       .depth = options.depth,
                                                                       .parts = options.parts}));
    if (recording_thread)
      recording_ =
          std::make_unique<RecordingThread>(recorder_, static_cast<size_t>(recorded_at_once));
  }

  [[nodiscard]] const DisplayMode& mode() const override { return mode_; }

  [[nodiscard]] ScanoutBuffer* acquire() override {
    // Buffers beyond the requested number are the recorder's and never deepen the queue.
    int in_use = 0;
    for (const auto& buffer : buffers_) in_use += buffer->state() == BufferState::Free ? 0 : 1;
    if (in_use >= buffers_in_use_) return nullptr;
    for (const auto& buffer : buffers_)
      if (buffer->try_acquire()) return buffer.get();
    return nullptr;
  }

  void discard(ScanoutBuffer* buffer) override { owned(buffer)->set_state(BufferState::Free); }

  [[nodiscard]] SubmitStatus submit(ScanoutBuffer* buffer, uint64_t id) noexcept override {
    if (off_) return SubmitStatus::Paused;
    if (pending_) return SubmitStatus::Busy;

    VirtualBuffer* const mine = owned(buffer);
    mine->set_state(BufferState::Pending);
    pending_ = Flip{tick_at(timeline_.sequence_at(now()) + 1), mine, id};
    return SubmitStatus::Accepted;
  }

  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept override {
    tick_ = tick_at(std::max(sequence + 1, timeline_.sequence_at(now())));
    return true;
  }

  [[nodiscard]] DisplayEvent wait_event(Nanoseconds deadline, int wake_fd) noexcept override {
    const Nanoseconds flip = pending_ ? pending_->event_time : Nanoseconds::max();
    const Nanoseconds next = std::min(flip, tick_ ? tick_->event_time : Nanoseconds::max());
    if (now() < next) (void)clock_->wait_until(std::min(deadline, next), wake_fd);
    if (now() < next) return {.kind = EventKind::Timeout};
    return flip == next ? deliver_flip() : deliver_tick();
  }

  [[nodiscard]] bool set_power(bool on) noexcept override {
    off_ = !on;
    return true;
  }

  [[nodiscard]] Nanoseconds now() const noexcept override { return clock_->now(); }

 private:
  struct Tick {
    uint64_t sequence = 0;
    Nanoseconds vblank_time{0};
    Nanoseconds event_time{0};
  };
  struct Flip : Tick {
    VirtualBuffer* buffer = nullptr;
    uint64_t id = 0;
  };

  [[nodiscard]] Tick tick_at(uint64_t sequence) const noexcept {
    const Nanoseconds vblank_time = timeline_.time_of(sequence);
    return {.sequence = sequence,
            .vblank_time = vblank_time,
            .event_time = vblank_time + (event_delay_ ? event_delay_(sequence) : Nanoseconds{0})};
  }

  static VirtualBuffer* owned(ScanoutBuffer* buffer) noexcept {
    auto* const mine = static_cast<VirtualBuffer*>(buffer);
    LENTICULE_CHECK(mine != nullptr && mine->state() == BufferState::Acquired);
    return mine;
  }

  /// Completes the pending flip: its buffer is displayed, the previous one is free.
  void land_flip() noexcept {
    VirtualBuffer* const buffer = pending_->buffer;
    buffer->set_state(BufferState::Displayed);
    record({.sequence = pending_->sequence, .id = pending_->id, .time = pending_->vblank_time},
           buffer);
    if (displayed_ != nullptr) displayed_->set_state(BufferState::Free);
    displayed_ = buffer;
    pending_.reset();
  }

  void record(const ShownFrame& shown, VirtualBuffer* buffer) noexcept {
    if (recording_)
      recording_->offer(shown, buffer);
    else if (recorder_)
      recorder_->record(shown, buffer->view());
  }

  DisplayEvent deliver_flip() noexcept {
    const DisplayEvent event{.kind = EventKind::Flip,
                             .id = pending_->id,
                             .sequence = pending_->sequence,
                             .time = pending_->vblank_time};
    land_flip();
    return event;
  }

  DisplayEvent deliver_tick() noexcept {
    const DisplayEvent event{
        .kind = EventKind::Vblank, .sequence = tick_->sequence, .time = tick_->vblank_time};
    tick_.reset();
    return event;
  }

  DisplayMode mode_;
  std::shared_ptr<Clock> clock_;
  VblankTimeline timeline_;
  EventDelay event_delay_;
  std::shared_ptr<ScanoutRecorder> recorder_;
  int buffers_in_use_;  ///< upper limit, not counting buffers held only by the recorder
  std::vector<std::unique_ptr<VirtualBuffer>> buffers_;

  // Presenter thread only.
  VirtualBuffer* displayed_ = nullptr;
  std::optional<Flip> pending_;
  std::optional<Tick> tick_;
  bool off_ = false;

  std::unique_ptr<RecordingThread> recording_;  // last member: the thread uses the buffers
};

/// Opens a virtual display. A flip submitted at time t is displayed from the first vblank after t.
/// Vblank 0 is the time of opening. The destructor records the frames that are still queued.
///
/// Throws Error(Usage) for options out of range and Error(Failed) if the buffers would take more
/// than half of the free memory.
[[nodiscard]] inline std::unique_ptr<Display> open_virtual_display(
    const VirtualDisplayOptions& options) {
  check_options(options);
  return std::make_unique<VirtualDisplay>(options);
}

}  // namespace lenticule::display
