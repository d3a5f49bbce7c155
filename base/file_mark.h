// SPDX-License-Identifier: Apache-2.0
// FileMark detects that a file was replaced or written to.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>

namespace lenticule {

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
