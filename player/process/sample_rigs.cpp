// SPDX-License-Identifier: Apache-2.0
#include "player/process/sample_rigs.h"

#include <algorithm>
#include <system_error>

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> rigs_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".toml") names.push_back(entry->path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

/// Returns the folder as a relative path if it lies in the working folder.
fs::path shortest(const fs::path& folder) {
  std::error_code error;
  const fs::path relative = fs::proximate(folder, error);
  return error || relative.empty() || *relative.begin() == ".." ? folder : relative;
}

}  // namespace

SampleRigs find_sample_rigs() {
  std::error_code error;
  fs::path above = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (; !error && above.has_relative_path(); above = above.parent_path())
    for (const char* place : {"share/lenticule/rigs", "scenes/rigs"})
      if (std::vector<std::string> names = rigs_in(above / place); !names.empty())
        return {shortest(above / place), std::move(names)};
  return {};
}

}  // namespace lenticule::player
