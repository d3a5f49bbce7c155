// SPDX-License-Identifier: Apache-2.0
// Small text files, whole: reading within a limit, writing so that there is never half a file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace lenticule::optics {

/// Throws Error(Input) for a file that cannot be read, is not a regular file or is larger than
/// max_bytes.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file, size_t max_bytes);

/// Writes a temporary file in the same folder, brings it to the disk and renames it to `file`. On
/// failure there is no temporary file left and `file` is as it was; throws Error(Failed).
void write_text_file(const std::filesystem::path& file, std::string_view text);

}  // namespace lenticule::optics
