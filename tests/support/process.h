// SPDX-License-Identifier: Apache-2.0
// Runs a program to its end and keeps its output.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::test {

struct ProcessLimits {
  std::chrono::seconds timeout{120};
  /// Size limit of the program's files: larger writes fail as on a full disk.
  std::optional<uint64_t> largest_file_bytes = std::nullopt;
  /// Signal sent once after `interrupt_after`; 0 for none.
  int interrupt_signal = 0;
  std::chrono::milliseconds interrupt_after{0};
};

struct ProcessResult {
  int exit_code = -1;  ///< -1 if a signal ended the program or it timed out
  int signal = 0;
  bool timed_out = false;
  std::string out;
  std::string err;
};

/// Runs a program; arguments[0] is its path. The output is read to the end; a program that outlives
/// the timeout is killed.
[[nodiscard]] ProcessResult run_process(const std::vector<std::string>& arguments,
                                        const ProcessLimits& limits = {});

/// A program that runs beside the test; it is killed at the end of the scope.
class BackgroundProcess {
 public:
  explicit BackgroundProcess(const std::vector<std::string>& arguments);
  ~BackgroundProcess();
  BackgroundProcess(const BackgroundProcess&) = delete;
  BackgroundProcess& operator=(const BackgroundProcess&) = delete;

  void signal(int number) const;
  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Waits at most `timeout` for the end and returns the result.
  [[nodiscard]] ProcessResult wait(std::chrono::seconds timeout);

 private:
  pid_t pid_ = -1;
  int out_ = -1;
  int err_ = -1;
};

}  // namespace lenticule::test
