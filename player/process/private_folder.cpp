// SPDX-License-Identifier: Apache-2.0
#include "player/process/private_folder.h"

#include <fmt/format.h>

#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "base/error.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

/// Maximum length of the folder's path: the limit of a socket path less the names below the folder.
constexpr size_t kMostPath = 50;

/// Returns candidate parent folders, the best first; any of them may be missing, full or read-only.
std::vector<fs::path> parent_folders() {
  const char* const users = std::getenv("XDG_RUNTIME_DIR");
  std::vector<fs::path> folders;
  for (const fs::path& folder : {runtime_folder(), fs::path(users != nullptr ? users : ""),
                                 fs::path("/tmp"), fs::path("/dev/shm"), fs::path("/var/tmp")})
    if (!folder.empty() && folder.string().size() <= kMostPath) folders.push_back(folder);
  return folders;
}

}  // namespace

PrivateFolder::PrivateFolder() {
  std::string tried;
  for (const fs::path& parent : parent_folders()) {
    try {
      folder_.emplace(parent);
      path_ = folder_->path() / "s";
      fs::create_directory(path_);
      return;
    } catch (const std::exception& error) {
      tried += fmt::format("{}{}", tried.empty() ? "" : ", ", error.what());
    }
  }
  throw Error(ErrorKind::Failed, fmt::format("cannot create a folder for a socket: {}", tried),
              "free some space in one of these folders");
}

std::filesystem::path runtime_folder() {
  const char* const folders = std::getenv("RUNTIME_DIRECTORY");
  if (folders == nullptr) return {};
  const std::string_view list(folders);
  return list.substr(0, list.find(':'));
}

}  // namespace lenticule::player
