// SPDX-License-Identifier: Apache-2.0
// Schedules retries for files that are written during playback: statistics, a recording, a trim. A
// full disk must not end the playback; failed writes are counted, reported and retried.
#pragma once

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <mutex>
#include <string>

#include "base/error_kinds.h"
#include "base/file.h"

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

  [[nodiscard]] bool due(Clock::time_point now = Clock::now()) const noexcept {
    const std::lock_guard lock(mutex_);
    return state_.reason.empty() || now >= again_;
  }
  void failed(const char* reason, Clock::time_point now = Clock::now()) noexcept {
    const std::lock_guard lock(mutex_);
    ++state_.failures;
    again_ = now + pause_;
    pause_ = std::min(2 * pause_, kLongestPause);
    try {
      state_.reason = *reason != '\0' ? reason : "cannot write";
    } catch (const std::exception&) {
      state_.reason = "no memory";  // short enough for the small-string buffer, so it cannot throw
    }
  }
  void succeeded() noexcept {
    const std::lock_guard lock(mutex_);
    state_.reason.clear();
    pause_ = kFirstPause;
  }
  /// Makes the next write due at once.
  void try_at_once() noexcept {
    const std::lock_guard lock(mutex_);
    again_ = {};
  }
  [[nodiscard]] WriteState state() const {
    const std::lock_guard lock(mutex_);
    return state_;
  }

 private:
  mutable std::mutex mutex_;
  WriteState state_;
  Clock::time_point again_{};
  std::chrono::seconds pause_ = kFirstPause;
};

/// Throws Error(Failed) for a file that can never be written: its folder does not exist, or the
/// name belongs to something other than a regular file. A full or read-only disk is not an error
/// here, because this state may change.
inline void require_writable_place(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  struct stat status {};
  const bool found = ::stat(folder.c_str(), &status) == 0;
  if (!found && (errno == ENOENT || errno == ENOTDIR))
    throw failed_error("{}: cannot write: its folder does not exist", file.string())
        .remedy("create the folder first");
  if (found && !S_ISDIR(status.st_mode))
    throw failed_error("{}: cannot write: {} is not a folder", file.string(), folder.string())
        .remedy("choose a file in an existing folder");
  if (::stat(file.c_str(), &status) == 0 && !S_ISREG(status.st_mode))
    throw failed_error("{}: cannot write: it is {}, not a regular file", file.string(),
                       kind_of_file(status.st_mode))
        .remedy("use another name");
}

}  // namespace lenticule
