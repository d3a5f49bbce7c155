// SPDX-License-Identifier: Apache-2.0
// report_error reports the error of a failed command.
#pragma once

#include "base/error.h"
#include "base/exit_code.h"

namespace lenticule::player {

/// Prints the error on standard error: one line of text and one with the remedy, or with `as_json`
/// one line {"error", "hint", "kind", "exit_code"}. Returns the exit code.
[[nodiscard]] ExitCode report_error(const Error& error, bool as_json) noexcept;

}  // namespace lenticule::player
