// SPDX-License-Identifier: Apache-2.0
#include "player/private_folder.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/error.h"
#include "player/start_history.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "lenticule-video-";
/// What a socket's whole path may take, less the names below the folder.
constexpr size_t kMostPath = 50;

/// Where such folders may be, the best first: any of them may be missing, full or read-only.
std::vector<fs::path> parent_folders() {
  const char* const users = std::getenv("XDG_RUNTIME_DIR");
  std::vector<fs::path> folders;
  for (const fs::path& folder : {runtime_folder(), fs::path(users != nullptr ? users : ""),
                                 fs::path("/tmp"), fs::path("/dev/shm"), fs::path("/var/tmp")})
    if (!folder.empty() && folder.string().size() <= kMostPath) folders.push_back(folder);
  return folders;
}

/// The process in a name that create_folder() made; 0 for other names.
pid_t owner_of(const std::string& name) {
  if (!name.starts_with(kPrefix)) return 0;
  pid_t pid = 0;
  const char* const begin = name.data() + kPrefix.size();
  const auto [end, error] = std::from_chars(begin, name.data() + name.size(), pid);
  const bool whole = error == std::errc() && end != name.data() + name.size() && *end == '-';
  return whole && pid > 0 ? pid : 0;
}

/// A player that was killed could not tidy up.
void remove_orphans(const fs::path& parent) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(parent, error)) {
    struct stat status {};
    const pid_t owner = owner_of(entry.path().filename().string());
    if (owner == 0 || kill(owner, 0) == 0 || errno != ESRCH) continue;
    const bool ours = lstat(entry.path().c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
                      status.st_uid == geteuid();
    std::error_code ignored;
    if (ours) fs::remove_all(entry.path(), ignored);
  }
}

}  // namespace

PrivateFolder::PrivateFolder() {
  std::string tried;
  for (const fs::path& parent : parent_folders()) {
    remove_orphans(parent);
    std::string name = (parent / fmt::format("{}{}-XXXXXX", kPrefix, getpid())).string();
    if (mkdtemp(name.data()) != nullptr) {
      path_ = name;
      return;
    }
    const std::string cause = std::generic_category().message(errno);
    tried += fmt::format("{}{}: {}", tried.empty() ? "" : ", ", parent.string(), cause);
  }
  throw Error(ErrorKind::Failed, fmt::format("no folder for a socket can be made: {}", tried),
              "free some space in one of these folders");
}

PrivateFolder::~PrivateFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace lenticule::player
