// SPDX-License-Identifier: Apache-2.0
// The two processes of `lenticule bench realtime`: the renderer, the log that it shares with the
// player, the display that notes when each frame appeared, and the figures of a run.
#pragma once

#include <sys/mman.h>
#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/lenticule-bench/render/bench_error.h"
#include "base/error.h"
#include "base/unique_fd.h"
#include "display/display.h"
#include "frames/rational.h"
#include "optics/rig.h"

namespace lenticule::bench {

/// The frames' ids are their indices in the playback. Thread safety: as display::Display. Lifetime:
/// must not outlive the display.
class TimedDisplay final : public display::Display {
 public:
  TimedDisplay(display::Display& display, uint64_t most_frames)
      : display_(display), shown_ns_(most_frames) {}

  /// Returns the time of the first vblank that showed each frame, by index, in nanoseconds of the
  /// display's clock; 0 if the frame was not shown. Call it after the playback.
  [[nodiscard]] const std::vector<int64_t>& shown_ns() const { return shown_ns_; }

  [[nodiscard]] const display::DisplayMode& mode() const override { return display_.mode(); }
  [[nodiscard]] display::ScanoutBuffer* acquire() override { return display_.acquire(); }
  void discard(display::ScanoutBuffer* buffer) override { display_.discard(buffer); }
  [[nodiscard]] display::SubmitStatus submit(display::ScanoutBuffer* buffer,
                                             uint64_t id) noexcept override {
    return display_.submit(buffer, id);
  }
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept override {
    return display_.request_vblank(sequence);
  }
  [[nodiscard]] display::DisplayEvent wait_event(display::Nanoseconds deadline,
                                                 int wake_fd) noexcept override {
    const display::DisplayEvent event = display_.wait_event(deadline, wake_fd);
    if (event.kind == display::EventKind::Flip && event.id < shown_ns_.size() &&
        shown_ns_[event.id] == 0)
      shown_ns_[event.id] = event.time.count();
    return event;
  }
  [[nodiscard]] bool set_power(bool on) noexcept override { return display_.set_power(on); }
  [[nodiscard]] display::Nanoseconds now() const noexcept override { return display_.now(); }

 private:
  display::Display& display_;
  std::vector<int64_t> shown_ns_;
};

// RunLog is memory that the renderer process writes and the player process reads. It keeps what was
// written when the renderer dies.

/// FrameRecord is the course of one frame. Times are nanoseconds of CLOCK_MONOTONIC, ascending.
struct FrameRecord {
  uint64_t number = 0;        ///< frame number of the scene
  int64_t due_ns = 0;         ///< instant of the scene that the frame shows
  int64_t free_ns = 0;        ///< the renderer had finished the frame before
  int64_t begun_ns = 0;       ///< the frame was due, and the renderer began
  int64_t committed_ns = 0;   ///< the scene was evaluated and committed to Embree
  int64_t rendered_ns = 0;    ///< the woven frame was complete
  int64_t acquired_ns = 0;    ///< the ring had a free slot
  int64_t published_ns = 0;   ///< the frame was copied into the slot and published
  uint64_t memory_bytes = 0;  ///< memory of the renderer, without the ring
  uint64_t in_use_bytes = 0;  ///< part that its code has allocated and not freed
  double tolerated_error = 0.0;
  double audited_rmse = 0.0;  ///< RMSE of the subpixels that the audit traced; 0 without an audit
};

class RunLog {
 public:
  /// State is written by one process and read by the other.
  struct State {
    std::atomic<uint64_t> count{0};  ///< number of published frames
    std::atomic<double> cpu_s{0.0};  ///< processor time of the renderer since the first frame
    std::atomic<bool> player_finished{false};  ///< the player has shown its last frame
    std::atomic<bool> stop{false};  ///< asks the renderer to end without comparing its samples
  };
  static_assert(std::atomic<uint64_t>::is_always_lock_free &&
                    std::atomic<double>::is_always_lock_free,
                "two processes share the state");

  /// Allocates the memory for `capacity` frames. Throws Error(Failed). Fork afterwards.
  explicit RunLog(uint64_t capacity);
  ~RunLog() { munmap(memory_, bytes_); }
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  [[nodiscard]] uint64_t capacity() const { return capacity_; }
  [[nodiscard]] State& state() const { return *state_; }

  /// Takes all memory now, so that it does not count as growth. Thread safety: the renderer.
  void prefault() noexcept {
    std::memset(static_cast<void*>(records_), 0, capacity_ * sizeof(FrameRecord));
  }
  /// Appends a record. The log must not be full. Thread safety: the renderer.
  void add(const FrameRecord& record) noexcept {
    const uint64_t count = state_->count;
    LENTICULE_CHECK(count < capacity_);
    records_[count] = record;
    state_->count = count + 1;
  }
  /// Returns the published frames in order. Thread safety: any process.
  [[nodiscard]] std::span<const FrameRecord> frames() const noexcept {
    return {records_, state_->count};
  }

 private:
  uint64_t capacity_;
  size_t bytes_;
  void* memory_;
  State* state_;
  FrameRecord* records_;
};

// The renderer of `lenticule bench realtime`: a process that renders a moving scene as fast as it
// can into the ring of a player, always the frame that is due.

struct LiveSetup {
  std::string scene;  ///< as ErrorScene takes it
  optics::Rig rig;
  ErrorEntrant entrant;
  double seconds = 60.0;
  frames::Rate fps{30, 1};  ///< frames of the scene per second
  int threads = 0;          ///< 0 = all cores
  int depth = 5;
  /// Frames per second for which the renderer chooses the tolerated error of each frame.
  std::optional<double> adapt_rate = {};
  int samples = 5;  ///< frames to compare with method full after the run
};

/// Returns the largest number of scene frames that the run can reach.
[[nodiscard]] uint64_t most_frames(const LiveSetup& setup);

/// RendererProcess is the running renderer. Its messages are
///   {"failed": TEXT, "hint": TEXT, "kind": NUMBER}, before or during the run, and nothing else; or
///   {"sample": {"frame", "number", "tolerated_error", "mse", "max"}} for each sample after the
///   player has finished, and last {"finished": true}.
///
/// Thread safety: one thread.
class RendererProcess {
 public:
  /// Starts the process, which waits for a player at `socket`. This process must not have other
  /// threads. Throws Error(Failed).
  RendererProcess(const LiveSetup& setup, const std::filesystem::path& socket, RunLog& log);
  /// Kills the process if it still runs.
  ~RendererProcess();
  RendererProcess(const RendererProcess&) = delete;
  RendererProcess& operator=(const RendererProcess&) = delete;

  /// Returns a descriptor that is readable when there is a message or the process has ended.
  [[nodiscard]] int message_fd() const { return messages_.get(); }
  /// Returns the next message; none when the process has ended, when it is silent for ten minutes,
  /// or some seconds after an interruption.
  [[nodiscard]] std::optional<nlohmann::json> next_message();

 private:
  UniqueFd messages_;
  std::string unread_;
  pid_t pid_ = -1;
};

/// Returns the figures of one run: {"frames_rendered", "frames_shown", "seconds_shown",
/// "frames_per_s", "latency_ms": {"p50", "p99", "max", "mean"}, "latency_parts_ms": {"begin",
/// "scene", "render", "ring", "copy", "panel"} (means, which add up to the mean), "shares":
/// {"scene", "render", "ring", "copy", "wait", "other"} (of the renderer's time, which add up to
/// 1), "bound" (the largest share's name), "memory_mib": {"start", "tenth" and "end" (means of the
/// second and the last tenth of the frames), "peak", "in_use_tenth", "in_use_end" (allocated and
/// not freed)}, "error_range": {"least", "median", "most", "last"} (tolerated errors of all
/// frames), "course":
/// [{"at_s", "frames_per_s", "latency_ms", "tolerated_error", "audited_rmse"}]}.
/// `shown_ns` has the time at which each of `frames` appeared, 0 for never; further ones are
/// ignored. Figures of no frame are 0, and "bound" is "nothing".
[[nodiscard]] nlohmann::json live_figures(std::span<const FrameRecord> frames,
                                          std::span<const int64_t> shown_ns);

/// Plots rate, tolerated error and error over time.
void plot_realtime(const nlohmann::json& run, const std::string& file);
}  // namespace lenticule::bench
