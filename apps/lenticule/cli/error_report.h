// SPDX-License-Identifier: Apache-2.0
// The end of a command that failed.
#pragma once

#include "base/error.h"
#include "base/exit_code.h"

namespace lenticule::player {

/// Prints the error on standard error, as one line of text and one with the remedy or, for those
/// who asked for JSON, as one line {"error", "hint", "kind", "exit_code"}. Returns the exit code.
[[nodiscard]] ExitCode report_error(const Error& error, bool as_json) noexcept;

}  // namespace lenticule::player
