// SPDX-License-Identifier: Apache-2.0
// Subprocess starts and ends another program; run_and_capture also captures its output.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule {

struct Pipe {
  UniqueFd reading;
  UniqueFd writing;
};
/// Returns a pipe that other programs do not inherit. Throws Error(Failed).
[[nodiscard]] Pipe make_pipe();

/// A descriptor of this process and its number in the new process.
struct PassedDescriptor {
  int here = -1;
  int there = -1;
};

/// ProcessEnd is how a process ended: by itself or by a signal.
struct ProcessEnd {
  int exit_code = -1;  ///< -1 if a signal ended it
  int signal = 0;
};

/// Subprocess owns a process, which has its own process group, so that Ctrl-C reaches only this
/// process. It starts with no signal blocked or ignored, with the descriptors that are passed and
/// with no others; its standard streams are /dev/null unless they are passed.
///
/// Thread safety: one thread at a time.
class Subprocess {
 public:
  /// Owns no process.
  Subprocess() = default;
  /// Starts arguments[0], the path of a program. Throws Error(Failed) "PROGRAM: cannot be started:
  /// cause".
  explicit Subprocess(const std::vector<std::string>& arguments,
                      const std::vector<PassedDescriptor>& passed = {});
  Subprocess(Subprocess&& other) noexcept : pid_(std::exchange(other.pid_, -1)) {}
  Subprocess& operator=(Subprocess&& other) noexcept {
    std::swap(pid_, other.pid_);
    return *this;
  }
  /// Calls end().
  ~Subprocess() { (void)end(); }

  /// Returns true until the process has been reaped.
  explicit operator bool() const { return pid_ > 0; }
  /// Returns -1 without a process.
  [[nodiscard]] pid_t pid() const { return pid_; }

  /// Kills the process and those that it started in its group.
  void kill() const noexcept;
  /// Waits until the process has ended and reaps it; returns none at the deadline.
  [[nodiscard]] std::optional<ProcessEnd> wait_until(
      std::chrono::steady_clock::time_point deadline) noexcept;
  /// Reaps the process; kills it if it still runs. Waits at most five seconds for the kernel.
  ProcessEnd end() noexcept;

 private:
  pid_t pid_ = -1;
};

/// ProgramRun is the result of run_and_capture().
struct ProgramRun {
  int exit_code = -1;  ///< -1 if a signal ended the program
  bool timed_out = false;
  double wall_seconds = 0.0;
  std::string output;  ///< standard output and error interleaved; the last 4 MiB
};

/// Runs arguments[0], the path of a program, with empty standard input until it and its output have
/// ended. Kills it when `limit` is over or `stops` returns true, which is called 20 times a second.
/// Throws Error(Failed) if it cannot be started.
[[nodiscard]] ProgramRun run_and_capture(const std::vector<std::string>& arguments,
                                         std::chrono::milliseconds limit,
                                         const std::function<bool()>& stops);

}  // namespace lenticule
