// SPDX-License-Identifier: Apache-2.0
#include "player/private_folder.h"

#include <unistd.h>

#include <cstdlib>
#include <string>

#include "player/start_history.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

/// What a socket's whole path may take, less the names below the folder.
constexpr size_t kMostPath = 50;

fs::path parent_folder() {
  const char* const users = std::getenv("XDG_RUNTIME_DIR");
  for (const fs::path& folder : {runtime_folder(), fs::path(users != nullptr ? users : "")}) {
    const std::string text = folder.string();
    if (!text.empty() && text.size() <= kMostPath && access(text.c_str(), W_OK) == 0) return folder;
  }
  return "/tmp";
}

}  // namespace

PrivateFolder::PrivateFolder() : folder_(parent_folder()) {}

}  // namespace lenticule::player
