// SPDX-License-Identifier: Apache-2.0
// find_sibling_program finds the other programs of lenticule.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

namespace lenticule::player {

/// Returns the path of an executable in this program's folder, in the folder for helper programs
/// (../libexec/lenticule), or as a helper program in that of lenticule (../../bin); none if there
/// is no such file.
[[nodiscard]] std::optional<std::filesystem::path> find_sibling_program(std::string_view name);

}  // namespace lenticule::player
