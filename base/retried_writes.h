// SPDX-License-Identifier: Apache-2.0
// Schedules retries for files that are written during playback: statistics, a recording, a trim. A
// full disk must not end the playback; failed writes are counted, reported and retried.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>

namespace lenticule {

/// WriteState summarises the writes of one file so far.
struct WriteState {
  uint64_t failures = 0;
  std::string reason{};  ///< cause of the last failure; empty once a write succeeded again
};

/// RetriedWrites decides when a failed write may be retried: after one second, then after pauses
/// that double up to half a minute. Thread safety: any thread.
class RetriedWrites {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kFirstPause{1};
  static constexpr std::chrono::seconds kLongestPause{30};

  [[nodiscard]] bool due(Clock::time_point now = Clock::now()) const noexcept;
  void failed(const char* reason, Clock::time_point now = Clock::now()) noexcept;
  void succeeded() noexcept;
  /// Makes the next write due at once.
  void try_at_once() noexcept;
  [[nodiscard]] WriteState state() const;

 private:
  mutable std::mutex mutex_;
  WriteState state_;
  Clock::time_point again_{};
  std::chrono::seconds pause_ = kFirstPause;
};

/// Throws Error(Failed) for a file that can never be written: its folder does not exist, or the
/// name belongs to something other than a regular file. A full or read-only disk is not an error
/// here, because this state may change.
void require_writable_place(const std::filesystem::path& file);

}  // namespace lenticule
