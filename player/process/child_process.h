// SPDX-License-Identifier: Apache-2.0
// run_child runs another program to its end and captures its output.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::player {

struct ChildResult {
  int exit_code = -1;  ///< -1 if a signal ended the program
  bool timed_out = false;
  double wall_seconds = 0.0;
  std::string output;  ///< standard output and error interleaved; the last 4 MiB
};

/// Runs arguments[0], the path of a program, with empty standard input. Kills the program when
/// `limit` is over or this process is interrupted. Throws Error(Failed) if it cannot be started.
[[nodiscard]] ChildResult run_child(const std::vector<std::string>& arguments,
                                    std::chrono::seconds limit);

/// Returns the path of an executable file of that name in $PATH.
[[nodiscard]] std::optional<std::string> find_program(const std::string& name);

}  // namespace lenticule::player
