// SPDX-License-Identifier: Apache-2.0
// Runs another program to its end and keeps what it says.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::player {

struct ChildResult {
  int exit_code = -1;  ///< -1 when a signal ended it
  bool timed_out = false;
  double wall_seconds = 0.0;
  std::string output;  ///< both of its streams, as they came; the last 4 MiB
};

/// arguments[0] is a program's path. Killed when `limit` is over or when we are interrupted. Its
/// input is empty. Throws Error(Failed) if it cannot be started.
[[nodiscard]] ChildResult run_child(const std::vector<std::string>& arguments,
                                    std::chrono::seconds limit);

/// The path of an executable file of that name in $PATH.
[[nodiscard]] std::optional<std::string> find_program(const std::string& name);

}  // namespace lenticule::player
