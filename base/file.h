// SPDX-License-Identifier: Apache-2.0
// Reads whole files, and writes files atomically: to a temporary name in the same folder, then
// sync, then rename.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule {

/// Replaces `file` with `bytes`; a reader sees either the old file or the whole new file. A
/// symbolic link keeps its target's name. Throws Error(Failed) that names the file and the cause,
/// and leaves no temporary file behind. Thread safety: any thread.
void write_file_atomically(const std::filesystem::path& file, std::span<const uint8_t> bytes);

/// Makes a rename in the file's folder durable (fsync of the folder). Does nothing where a folder
/// cannot be synchronised: the file itself is complete in either case.
void sync_folder_of(const std::filesystem::path& file) noexcept;

/// Returns the remedy for a file that cannot be opened for reading because of `error`, an errno.
[[nodiscard]] std::string read_remedy(const std::filesystem::path& file, int error);

struct OpenedFile {
  UniqueFd descriptor;
  uint64_t bytes = 0;
};
/// Opens a regular file for reading. Throws the same errors as read_whole_file().
[[nodiscard]] OpenedFile open_regular_file(const std::filesystem::path& file, uint64_t limit_bytes);

/// Returns the bytes of the whole file. Throws Error(Input) that names the file and the cause if
/// the file is missing, is not a regular file or is larger than `limit_bytes`. Never blocks on a
/// pipe.
[[nodiscard]] std::vector<uint8_t> read_whole_file(const std::filesystem::path& file,
                                                   uint64_t limit_bytes);

/// Do the same as read_whole_file() and write_file_atomically() for text.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file, uint64_t limit_bytes);
void write_text_file(const std::filesystem::path& file, std::string_view text);

}  // namespace lenticule
