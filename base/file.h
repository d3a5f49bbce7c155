// SPDX-License-Identifier: Apache-2.0
// Whole files or none: written under a temporary name in the same folder, synced, renamed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule {

/// Replaces `file` with `bytes`; readers see the old file or the whole new one. A symbolic link
/// keeps pointing at the file it names. Throws Error(Failed) naming file and cause; nothing is left
/// behind then. Safe from any thread.
void write_file_atomically(const std::filesystem::path& file, std::span<const uint8_t> bytes);

/// Makes a rename in the file's folder last. Where a folder cannot be synchronised, nothing
/// happens: the file is whole all the same.
void sync_folder_of(const std::filesystem::path& file) noexcept;

struct OpenedFile {
  UniqueFd descriptor;
  uint64_t bytes = 0;
};
/// Opens a regular file for reading. Throws as read_whole_file() does.
[[nodiscard]] OpenedFile open_regular_file(const std::filesystem::path& file, uint64_t limit_bytes);

/// The whole file. Throws Error(Input) naming file and cause: missing, not a regular file (never
/// waits for a pipe), larger than `limit_bytes`.
[[nodiscard]] std::vector<uint8_t> read_whole_file(const std::filesystem::path& file,
                                                   uint64_t limit_bytes);

/// The same two for text.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file, uint64_t limit_bytes);
void write_text_file(const std::filesystem::path& file, std::string_view text);

}  // namespace lenticule
