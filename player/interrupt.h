// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and SIGTERM: the first asks running loops to finish what they are at, the second ends now.
#pragma once

#include "player/exit_code.h"

namespace lenticule::player {

/// Installs the handlers for SIGINT and SIGTERM for the whole process and ignores SIGPIPE and
/// SIGXFSZ, whose causes are reported as failed writes. Once.
void install_interrupt_handlers();

/// 0, or the signal that asked us to stop.
[[nodiscard]] int interrupt_signal() noexcept;
[[nodiscard]] inline bool interrupted() noexcept {
  return interrupt_signal() != 0;
}

/// A descriptor that becomes readable when interrupted, for poll loops.
[[nodiscard]] int interrupt_fd() noexcept;

/// kOk when not interrupted, else 130 or 143.
[[nodiscard]] ExitCode interrupt_exit_code() noexcept;

}  // namespace lenticule::player
