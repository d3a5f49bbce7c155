// SPDX-License-Identifier: Apache-2.0
// Names kinds of files, for messages about files that are not regular.
#pragma once

#include <sys/stat.h>

namespace lenticule {

/// Returns "a folder", "a pipe", "a socket", "a device" or "a regular file".
[[nodiscard]] inline const char* kind_of_file(mode_t mode) noexcept {
  if (S_ISREG(mode)) return "a regular file";
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

}  // namespace lenticule
