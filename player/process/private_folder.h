// SPDX-License-Identifier: Apache-2.0
// PrivateFolder is a folder that other users cannot read, for a socket between a process and its
// child.
#pragma once

#include <fmt/format.h>

#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/error_kinds.h"
#include "base/temporary.h"

namespace lenticule::player {

/// Returns the service's own folder under /run as its manager names it; empty if there is none.
[[nodiscard]] inline std::filesystem::path runtime_folder() {
  const char* const folders = std::getenv("RUNTIME_DIRECTORY");
  if (folders == nullptr) return {};
  const std::string_view list(folders);
  return list.substr(0, list.find(':'));
}

/// PrivateFolder creates a folder of mode 0700 in the first writable place of: the service's or the
/// user's runtime folder, /tmp, /dev/shm, /var/tmp. Throws Error(Failed) if none is writable.
/// Lifetime: removed with this object; if its process dies, the next PrivateFolder removes it.
class PrivateFolder {
 public:
  PrivateFolder() {
    std::string tried;
    for (const std::filesystem::path& parent : parent_folders()) {
      try {
        folder_.emplace(parent);
        path_ = folder_->path() / "s";
        std::filesystem::create_directory(path_);
        return;
      } catch (const std::exception& error) {
        tried += fmt::format("{}{}", tried.empty() ? "" : ", ", error.what());
      }
    }
    throw failed_error("cannot create a folder for a socket: {}", tried)
        .remedy("free some space in one of these folders");
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  /// Maximum length of the folder's path: the limit of a socket path less the names below the
  /// folder.
  static constexpr size_t kMostPath = 50;

  /// Returns candidate parent folders, the best first; any of them may be missing, full or
  /// read-only.
  static std::vector<std::filesystem::path> parent_folders() {
    const char* const users = std::getenv("XDG_RUNTIME_DIR");
    std::vector<std::filesystem::path> folders;
    for (const std::filesystem::path& folder :
         {runtime_folder(), std::filesystem::path(users != nullptr ? users : ""),
          std::filesystem::path("/tmp"), std::filesystem::path("/dev/shm"),
          std::filesystem::path("/var/tmp")})
      if (!folder.empty() && folder.string().size() <= kMostPath) folders.push_back(folder);
    return folders;
  }
  std::optional<TemporaryFolder> folder_;  ///< empty only during construction
  /// A sub-folder: a listening socket locks the folder that contains it, and folder_ is locked
  /// already.
  std::filesystem::path path_;
};

}  // namespace lenticule::player
