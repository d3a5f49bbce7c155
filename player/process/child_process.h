// SPDX-License-Identifier: Apache-2.0
// Finds and runs other programs.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/subprocess.h"

namespace lenticule::player {

/// Calls run_and_capture(), which also kills the program when this process is interrupted.
[[nodiscard]] ProgramRun run_child(const std::vector<std::string>& arguments,
                                   std::chrono::seconds limit);

/// Returns the path of an executable file of that name in $PATH.
[[nodiscard]] std::optional<std::string> find_program(const std::string& name);

/// Finds the other programs of lenticule: returns the path of an executable in this program's
/// folder, in the folder for helper programs
/// (../libexec/lenticule), or as a helper program in that of lenticule (../../bin); none if there
/// is no such file.
[[nodiscard]] std::optional<std::filesystem::path> find_sibling_program(std::string_view name);

}  // namespace lenticule::player
