// SPDX-License-Identifier: Apache-2.0
// Files that are written while something more important goes on: statistics, a recording, a trim.
// A full disk must not end the film; what could not be written is counted, said, and tried again.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>

namespace lenticule {

/// How the writes of one thing went so far.
struct WriteState {
  uint64_t failures = 0;
  std::string reason{};  ///< of the last failure; empty once a write succeeded again
};

/// Says when a write may be tried again after it failed: after a second, then after pauses that
/// double up to half a minute. Any thread.
class RetriedWrites {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kFirstPause{1};
  static constexpr std::chrono::seconds kLongestPause{30};

  [[nodiscard]] bool due(Clock::time_point now = Clock::now()) const noexcept;
  void failed(const char* reason, Clock::time_point now = Clock::now()) noexcept;
  void succeeded() noexcept;
  /// Lets the next write be tried at once.
  void try_at_once() noexcept;
  [[nodiscard]] WriteState state() const;

 private:
  mutable std::mutex mutex_;
  WriteState state_;
  Clock::time_point again_{};
  std::chrono::seconds pause_ = kFirstPause;
};

/// Throws Error(Failed) for a file that can never be written: its folder does not exist, or
/// something that is no regular file has the name. A disk that is full or read-only may change.
void require_writable_place(const std::filesystem::path& file);

}  // namespace lenticule
