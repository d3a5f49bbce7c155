// SPDX-License-Identifier: Apache-2.0
#include "player/process/sibling_program.h"

#include <unistd.h>

#include <system_error>

namespace lenticule::player {

namespace fs = std::filesystem;

std::optional<fs::path> find_sibling_program(std::string_view name) {
  std::error_code error;
  const fs::path here = fs::read_symlink("/proc/self/exe", error).parent_path();
  if (error) return std::nullopt;  // no /proc
  for (const fs::path& folder : {here, here / "../libexec/lenticule", here / "../../bin"}) {
    const fs::path program = folder / name;
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  return std::nullopt;
}

}  // namespace lenticule::player
