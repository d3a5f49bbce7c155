// SPDX-License-Identifier: Apache-2.0
// Finds and runs other programs.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/subprocess.h"
#include "player/process/interrupt.h"

namespace lenticule::player {

/// Calls run_and_capture(), which also kills the program when this process is interrupted.
[[nodiscard]] inline ProgramRun run_child(const std::vector<std::string>& arguments,
                                          std::chrono::seconds limit) {
  return run_and_capture(arguments, limit, interrupted);
}

/// Returns the path of an executable file of that name in $PATH.
[[nodiscard]] inline std::optional<std::string> find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const size_t end = std::min(rest.find(':'), rest.size());
    const auto file = std::filesystem::path(rest.substr(0, end)) / name;
    if (end > 0 && access(file.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(file))
      return file.string();
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return std::nullopt;
}

}  // namespace lenticule::player
