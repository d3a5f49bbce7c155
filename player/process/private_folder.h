// SPDX-License-Identifier: Apache-2.0
// PrivateFolder is a folder that other users cannot read, for a socket between a process and its
// child.
#pragma once

#include <filesystem>
#include <optional>

#include "base/temporary.h"

namespace lenticule::player {

/// Returns the service's own folder under /run as its manager names it; empty if there is none.
[[nodiscard]] std::filesystem::path runtime_folder();

/// PrivateFolder creates a folder of mode 0700 in the first writable place of: the service's or the
/// user's runtime folder, /tmp, /dev/shm, /var/tmp. Throws Error(Failed) if none is writable.
/// Lifetime: removed with this object; if its process dies, the next PrivateFolder removes it.
class PrivateFolder {
 public:
  PrivateFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::optional<TemporaryFolder> folder_;  ///< empty only during construction
  /// A sub-folder: a listening socket locks the folder that contains it, and folder_ is locked
  /// already.
  std::filesystem::path path_;
};

}  // namespace lenticule::player
