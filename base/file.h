// SPDX-License-Identifier: Apache-2.0
// Reads whole files, and writes files atomically: to a temporary name in the same folder, then
// sync, then rename.
#pragma once

#include <sys/stat.h>
#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule {

// Names kinds of files, for messages about files that are not regular.

/// Returns "a folder", "a pipe", "a socket", "a device" or "a regular file".
[[nodiscard]] inline const char* kind_of_file(mode_t mode) noexcept {
  if (S_ISREG(mode)) return "a regular file";
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

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

/// Reads from the beginning of a regular file until `to` is full or the file ends. Returns the
/// number of bytes, or -1 with errno.
[[nodiscard]] ssize_t read_from_start(int descriptor, std::span<uint8_t> to) noexcept;

/// Returns a file without a name that has these bytes in memory. Throws Error(Failed).
[[nodiscard]] UniqueFd file_in_memory(std::span<const uint8_t> bytes);

/// Returns the bytes of the whole file. Throws Error(Input) that names the file and the cause if
/// the file is missing, is not a regular file or is larger than `limit_bytes`. Never blocks on a
/// pipe.
[[nodiscard]] std::vector<uint8_t> read_whole_file(const std::filesystem::path& file,
                                                   uint64_t limit_bytes);

/// Do the same as read_whole_file() and write_file_atomically() for text.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file, uint64_t limit_bytes);
void write_text_file(const std::filesystem::path& file, std::string_view text);

/// Returns the paths of a folder's entries in the natural order of their names: those that were
/// read before an error, if any, which `error` receives.
[[nodiscard]] std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder,
                                                            std::error_code* error = nullptr);

/// FileMark detects that a file was replaced or written to.
///
/// FileMark identifies the content of a file. Two marks of one name are equal as long as the name
/// refers to the same file with the same content.
struct FileMark {
  bool there = false;
  uint64_t device = 0, inode = 0;
  int64_t size = 0;
  int64_t written_s = 0, written_ns = 0;
  int64_t changed_s = 0,
          changed_ns =
              0;  ///< unlike the modification time, this time cannot be set back by a program
  friend bool operator==(const FileMark&, const FileMark&) = default;
};

/// Returns the mark of `file`. Costs one stat().
[[nodiscard]] inline FileMark mark_of(const std::filesystem::path& file) noexcept {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return {};
  return {.there = true,
          .device = status.st_dev,
          .inode = status.st_ino,
          .size = status.st_size,
          .written_s = status.st_mtim.tv_sec,
          .written_ns = status.st_mtim.tv_nsec,
          .changed_s = status.st_ctim.tv_sec,
          .changed_ns = status.st_ctim.tv_nsec};
}

}  // namespace lenticule
