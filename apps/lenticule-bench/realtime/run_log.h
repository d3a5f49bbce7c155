// SPDX-License-Identifier: Apache-2.0
// RunLog is memory that the renderer process of `lenticule bench realtime` writes and the player
// process reads. It keeps what was written when the renderer dies.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>

namespace lenticule::bench {

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
  /// Allocates the memory for `capacity` frames. Throws Error(Failed). Fork afterwards.
  explicit RunLog(uint64_t capacity);
  ~RunLog();
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  [[nodiscard]] uint64_t capacity() const { return capacity_; }

  /// Takes all memory now, so that it does not count as growth. Thread safety: the renderer.
  void prefault() noexcept;
  /// Appends a record. The log must not be full. Thread safety: the renderer.
  void add(const FrameRecord& record) noexcept;
  /// Ends the renderer's part with its processor time since the first frame. Thread safety: the
  /// renderer.
  void finish(double cpu_s) noexcept;

  /// Returns the published frames in order. Thread safety: any process.
  [[nodiscard]] std::span<const FrameRecord> frames() const noexcept;
  /// Returns the processor time that finish() stored; 0 before that.
  [[nodiscard]] double cpu_s() const noexcept;

  /// The player sets this when it has shown its last frame; `stop` asks the renderer to end without
  /// comparing its samples. Thread safety: any process.
  void set_player_finished(bool stop) noexcept;
  [[nodiscard]] bool is_player_finished() const noexcept;
  [[nodiscard]] bool is_stopped() const noexcept;

 private:
  struct Header {
    std::atomic<uint64_t> count{0};
    std::atomic<double> cpu_s{0.0};
    std::atomic<bool> player_finished{false};
    std::atomic<bool> stop{false};
  };
  static_assert(std::atomic<uint64_t>::is_always_lock_free &&
                    std::atomic<double>::is_always_lock_free,
                "two processes share the header");

  uint64_t capacity_;
  size_t bytes_;
  void* memory_;
  Header* header_;
  FrameRecord* records_;
};

}  // namespace lenticule::bench
