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
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>

#include "base/error.h"
#include "player/start_history.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "lenticule-video-";
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
  const fs::path parent = parent_folder();
  remove_orphans(parent);
  std::string name = (parent / fmt::format("{}{}-XXXXXX", kPrefix, getpid())).string();
  if (mkdtemp(name.data()) == nullptr)
    throw Error(ErrorKind::Failed,
                fmt::format("{}: cannot be made: {}", name, std::strerror(errno)));
  path_ = name;
}

PrivateFolder::~PrivateFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace lenticule::player
