// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/other_program.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "player/process/child_process.h"

namespace lenticule::cli {

void become_program(const OtherProgram& program, const char* command, char* const* arguments) {
  const auto path = player::find_sibling_program(program.name);
  if (!path)
    throw Error(ErrorKind::Failed, fmt::format("{}: {} is not installed", command, program.name),
                fmt::format("install the package {}", program.package));
  execv(path->c_str(), arguments);
  throw Error(ErrorKind::Failed, fmt::format("{}: cannot start {}: {}", command, path->string(),
                                             std::strerror(errno)));
}

}  // namespace lenticule::cli
