// SPDX-License-Identifier: Apache-2.0
#include "player/process/child_process.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <system_error>

#include "player/process/interrupt.h"

namespace lenticule::player {

ProgramRun run_child(const std::vector<std::string>& arguments, std::chrono::seconds limit) {
  return run_and_capture(arguments, limit, interrupted);
}

std::optional<std::string> find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const size_t end = std::min(rest.find(':'), rest.size());
    const auto file = std::filesystem::path(rest.substr(0, end)) / name;
    if (end > 0 && access(file.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(file))
      return file.string();
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return std::nullopt;
}

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
