// SPDX-License-Identifier: Apache-2.0
// ExitCode lists the exit codes of all commands; scripts depend on the values
// (docs/play/player.md).
#pragma once

#include "base/error.h"

namespace lenticule {

enum ExitCode : int {
  kOk = 0,
  kFailed = 1,
  kUsage = 2,
  kDevice = 3,
  kInput = 4,
  kQuality = 5,
  kHungUp = 129,
  kInterrupted = 130,
  kTerminated = 143,
};

[[nodiscard]] constexpr ExitCode exit_code_of(ErrorKind kind) {
  return static_cast<ExitCode>(static_cast<int>(kind));
}

}  // namespace lenticule
