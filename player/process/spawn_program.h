// SPDX-License-Identifier: Apache-2.0
// Starts a program of ours that works for this process: a decoder.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace lenticule::player {

/// A descriptor of this process and its number in the other one.
struct PassedDescriptor {
  int here = -1;
  int there = -1;
};

/// Starts arguments[0] in a process group of its own, with no signal blocked or ignored. Its
/// standard streams are /dev/null unless `passed` names them. Returns 0, or why it did not start.
[[nodiscard]] int spawn_program(const std::vector<std::string>& arguments,
                                const std::vector<PassedDescriptor>& passed, pid_t& pid);

}  // namespace lenticule::player
