// SPDX-License-Identifier: Apache-2.0
// OtherProgram is a program of lenticule that has a package of its own, because it needs libraries
// that a machine with a panel does without.
#pragma once

namespace lenticule::cli {

struct OtherProgram {
  const char* name;
  const char* package;
};

/// Replaces this process by the program. `arguments` ends with a null pointer; arguments[0] is the
/// name in lists of processes. Throws Error(Failed) with `command` as object if the program is not
/// installed or cannot be started.
[[noreturn]] void become_program(const OtherProgram& program, const char* command,
                                 char* const* arguments);

}  // namespace lenticule::cli
