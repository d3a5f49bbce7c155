// SPDX-License-Identifier: Apache-2.0
// Signal handling for Ctrl-C, SIGTERM and SIGHUP: the first signal asks running loops to finish
// their current step, the second ends the process. A closing terminal sends SIGHUP more than once,
// so SIGHUP never ends the process immediately; a process without a terminal may treat SIGHUP as a
// request to reload.
#pragma once

#include <chrono>
#include <string>

#include "base/error.h"
#include "base/exit_code.h"

namespace lenticule::player {

/// Installs the handlers for SIGINT, SIGTERM and, unless it is ignored already (nohup), SIGHUP for
/// the whole process, and ignores SIGPIPE and SIGXFSZ, whose causes are reported as failed writes.
/// Call it once.
void install_interrupt_handlers();

/// Returns true if the process has a terminal that may close.
[[nodiscard]] bool has_terminal() noexcept;
/// Makes SIGHUP a request to reload instead of an interruption.
void reload_at_hangup() noexcept;
/// Returns true if a reload was requested since the last call.
[[nodiscard]] bool take_reload_request() noexcept;

/// Writes the text, which must stay, to standard error at the first Ctrl-C: for slow work.
void say_at_interrupt(const char* text) noexcept;

/// Returns the signal that asked the process to stop, or 0.
[[nodiscard]] int interrupt_signal() noexcept;
[[nodiscard]] inline bool interrupted() noexcept { return interrupt_signal() != 0; }

/// Waits, unless the process is interrupted. Returns false then.
bool wait_unless_interrupted(std::chrono::milliseconds duration) noexcept;

/// Returns a descriptor for poll loops that becomes readable when the process is interrupted.
[[nodiscard]] int interrupt_fd() noexcept;

/// Returns kOk when not interrupted, else 129, 130 or 143.
[[nodiscard]] ExitCode interrupt_exit_code() noexcept;

/// Thrown by a step that does not finish because the process is interrupted. The program then ends
/// with interrupt_exit_code(), and without a message.
class Interrupted final : public Error {
 public:
  explicit Interrupted(const std::string& object)
      : Error(ErrorKind::Failed, object + ": interrupted") {}
};

}  // namespace lenticule::player
