// SPDX-License-Identifier: Apache-2.0
// spawn_program starts a helper program of lenticule, such as the decoder.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace lenticule::player {

/// A descriptor of this process and its number in the new process.
struct PassedDescriptor {
  int here = -1;
  int there = -1;
};

/// Starts arguments[0] in its own process group with no signal blocked or ignored. Its standard
/// streams are /dev/null unless `passed` names them. Returns 0 or an errno value.
[[nodiscard]] int spawn_program(const std::vector<std::string>& arguments,
                                const std::vector<PassedDescriptor>& passed, pid_t& pid);

}  // namespace lenticule::player
