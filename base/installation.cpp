// SPDX-License-Identifier: Apache-2.0
#include "base/installation.h"

#include <fmt/format.h>
#include <unistd.h>

#include <system_error>

#include "base/error_kinds.h"

namespace lenticule {

namespace fs = std::filesystem;

std::optional<fs::path> find_sibling_program(std::string_view name) {
  std::error_code error;
  const fs::path here = fs::read_symlink("/proc/self/exe", error).parent_path();
  if (error) return std::nullopt;  // no /proc
  for (const fs::path& folder : {here, here / kHelpersFromPrograms, here / kProgramsFromHelpers}) {
    const fs::path program = folder / name;
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  return std::nullopt;
}

fs::path require_program(std::string_view object, std::string_view name, std::string_view package) {
  if (auto program = find_sibling_program(name)) return *std::move(program);
  throw failed_error("{}: {} is not installed", object, name)
      .remedy(fmt::format("install the package {}", package));
}

}  // namespace lenticule
