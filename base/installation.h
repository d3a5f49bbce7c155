// SPDX-License-Identifier: Apache-2.0
// The installed tree: where programs find each other and their files. CMake chooses the folders;
// they are searched relative to the running program, so that the tree can be moved.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

namespace lenticule {

/// Relative paths between the folder of users' programs and that of helper programs:
/// "../libexec/lenticule" and "../../bin".
extern const char* const kHelpersFromPrograms;
extern const char* const kProgramsFromHelpers;
/// The folder of data below the prefix, or an absolute path: "share".
extern const char* const kDataFolder;
/// The administrator's folder of rigs: "/etc/lenticule".
extern const char* const kSystemFolder;

/// Finds the other programs of lenticule: returns the path of an executable in this program's
/// folder, in the folder of helper programs, or as a helper program in that of lenticule; none if
/// there is no such file.
[[nodiscard]] std::optional<std::filesystem::path> find_sibling_program(std::string_view name);

/// Returns the same path. Throws Error(Failed) "OBJECT: NAME is not installed", with the package in
/// the hint.
[[nodiscard]] std::filesystem::path require_program(std::string_view object, std::string_view name,
                                                    std::string_view package);

}  // namespace lenticule
