// SPDX-License-Identifier: Apache-2.0
// A folder that nobody else can look into, for a socket between a process and its child.
#pragma once

#include <filesystem>
#include <optional>

#include "base/temporary.h"

namespace lenticule::player {

/// Mode 0700, under the service's or the user's runtime folder, /tmp, /dev/shm or /var/tmp,
/// whichever first can be written; gone with this object, or with the next one that finds its
/// process dead. Throws Error(Failed) where none can.
class PrivateFolder {
 public:
  PrivateFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return folder_->path(); }

 private:
  std::optional<TemporaryFolder> folder_;  ///< empty only while it is being made
};

}  // namespace lenticule::player
