// SPDX-License-Identifier: Apache-2.0
#include "player/scratch_folder.h"

#include <fmt/format.h>

#include <cstdlib>
#include <system_error>

#include "base/error.h"

namespace lenticule::player {

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder() {
  std::string name = (fs::temp_directory_path() / "lenticule-bench-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr)
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot be made", name));
  folder_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace lenticule::player
