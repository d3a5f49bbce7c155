// SPDX-License-Identifier: Apache-2.0
// A folder that nobody else can look into, for a socket between a process and its child.
#pragma once

#include <filesystem>
#include <optional>

#include "base/temporary.h"

namespace lenticule::player {

/// The service's own folder under /run, as its manager names it; empty if there is none.
[[nodiscard]] std::filesystem::path runtime_folder();

/// Mode 0700, under the service's or the user's runtime folder, /tmp, /dev/shm or /var/tmp,
/// whichever first can be written; gone with this object, or with the next one that finds its
/// process dead. Throws Error(Failed) where none can.
class PrivateFolder {
 public:
  PrivateFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::optional<TemporaryFolder> folder_;  ///< empty only while it is being made
  /// Inside it: a listening socket locks the folder that it is in, and folder_ is locked already.
  std::filesystem::path path_;
};

}  // namespace lenticule::player
