// SPDX-License-Identifier: Apache-2.0
// Ctrl-C, SIGTERM and SIGHUP: the first asks running loops to finish what they are at, the second
// ends now. SIGHUP of a terminal that closes comes more than once, and never ends at once; a
// process without a terminal may take it for a request to reload.
#pragma once

#include "base/exit_code.h"

namespace lenticule::player {

/// Installs the handlers for SIGINT, SIGTERM and, unless it is ignored already (nohup), SIGHUP for
/// the whole process and ignores SIGPIPE and SIGXFSZ, whose causes are reported as failed writes.
/// Once.
void install_interrupt_handlers();

/// Tells whether the process has a terminal that may close.
[[nodiscard]] bool has_terminal() noexcept;
/// From now on SIGHUP is no interruption but a request to reload.
void reload_at_hangup() noexcept;
/// True if there was such a request since the last call.
[[nodiscard]] bool take_reload_request() noexcept;

/// 0, or the signal that asked us to stop.
[[nodiscard]] int interrupt_signal() noexcept;
[[nodiscard]] inline bool interrupted() noexcept {
  return interrupt_signal() != 0;
}

/// A descriptor that becomes readable when interrupted, for poll loops.
[[nodiscard]] int interrupt_fd() noexcept;

/// kOk when not interrupted, else 129, 130 or 143.
[[nodiscard]] ExitCode interrupt_exit_code() noexcept;

}  // namespace lenticule::player
