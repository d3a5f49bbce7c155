// SPDX-License-Identifier: Apache-2.0
// A folder that nobody else can look into, for a socket between a process and its child.
#pragma once

#include <filesystem>

namespace lenticule::player {

/// Mode 0700, under the service's or the user's runtime folder, /tmp, /dev/shm or /var/tmp,
/// whichever first can be written; gone with this object, or with the next one that finds its
/// process dead. Throws Error(Failed) where none can.
class PrivateFolder {
 public:
  PrivateFolder();
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace lenticule::player
