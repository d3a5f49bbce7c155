// SPDX-License-Identifier: Apache-2.0
// run_child runs another program until it ends or this process is interrupted.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "base/subprocess.h"

namespace lenticule::player {

/// Calls run_and_capture(), which also kills the program when this process is interrupted.
[[nodiscard]] ProgramRun run_child(const std::vector<std::string>& arguments,
                                   std::chrono::seconds limit);

/// Returns the path of an executable file of that name in $PATH.
[[nodiscard]] std::optional<std::string> find_program(const std::string& name);

}  // namespace lenticule::player
